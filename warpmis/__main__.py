"""`python -m warpmis`."""

from warpmis.cli import program

if __name__ == "__main__":
    program()
