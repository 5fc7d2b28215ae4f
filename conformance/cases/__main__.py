"""`python -m conformance.cases`: the command of `conformance.cases.corpus`."""

import sys

from conformance.cases.corpus import main

if __name__ == "__main__":
    sys.exit(main())
