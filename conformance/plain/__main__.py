"""`python -m conformance.plain`: serve the plain stepper through protocol 1."""

import sys

from conformance.plain import flow, next_collision, trajectory
from scene.protocol.wire import serve

if __name__ == "__main__":
    serve("plain", next_collision, trajectory, sys.stdin.buffer, sys.stdout.buffer, flow=flow)
