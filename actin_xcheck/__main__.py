"""`python -m actin_xcheck`."""

import sys

try:
    from actin_xcheck.cli.app import main
except KeyboardInterrupt:  # within the seconds of imports nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    main()
