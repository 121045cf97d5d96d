"""`python -m actin_xcheck`."""

from actin_xcheck.cli import main

if __name__ == "__main__":
    main()
