"""Draws comments at random, to judge their wording: python3 tests/scripts/comments.py SEED [COUNT]

Prints COUNT (60) comment blocks of at least 6 words from src/ and crates/*/src, each with its path and first line. A block is a run of adjacent
lines that hold nothing but a comment of one kind (`//`, `///` or `//!`). The same seed on the same source draws the same comments.
"""

import pathlib
import random
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
FEWEST_WORDS = 6


def blocks(path):
    """Line number and lines of every comment block of a file."""
    start, kind, lines = 0, None, []
    for number, line in enumerate([*path.read_text(encoding="utf-8").splitlines(), ""], 1):
        comment = re.match(r"\s*(//[/!]?)(.*)", line)
        if lines and (comment is None or comment[1] != kind):
            yield start, lines
            lines = []
        if comment:
            if not lines:
                start, kind = number, comment[1]
            lines.append(comment[2].strip())


def main():
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    seed, count = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) == 3 else 60
    found = []
    for source in [ROOT / "src", *ROOT.glob("crates/*/src")]:
        for path in source.rglob("*.rs"):
            name = path.relative_to(ROOT).as_posix()
            found += [(name, start, lines) for start, lines in blocks(path) if len(" ".join(lines).split()) >= FEWEST_WORDS]
    found.sort()
    for name, start, lines in random.Random(seed).sample(found, min(count, len(found))):
        print(f"{name}:{start}", *(f"    {line}" for line in lines), sep="\n")


if __name__ == "__main__":
    main()
