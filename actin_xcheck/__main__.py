"""`python -m actin_xcheck`."""

import sys

if __name__ == "__main__":  # what it starts need not import all of it
    try:
        from actin_xcheck.cli.app import main
    except KeyboardInterrupt:  # within the seconds of imports nothing has begun
        sys.exit(130)
    main()
