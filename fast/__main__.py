"""`python -m fast`: serve the fast stepper through protocol 1."""

import sys

from fast.stepper import next_collision
from scene.wire import serve

if __name__ == "__main__":
    serve("fast", next_collision, sys.stdin.buffer, sys.stdout.buffer)
