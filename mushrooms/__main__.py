"""`python -m mushrooms`: the command without its installed entry point."""

from mushrooms.main import run

if __name__ == "__main__":
    run()
