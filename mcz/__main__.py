"""The command line as ``python -m mcz``."""

from mcz.cli.main import main

if __name__ == "__main__":
    main()
