"""Counts code by floor: python3 tests/scripts/code_lines.py [SRC]

Left out are blank lines, comments, and unit tests: modules `tests` at the end of a file and files `tests.rs`.
"""

import collections
import os
import sys


def code(text):
    """Lines of code of a file."""
    text = text.split("#[cfg(test)]\nmod tests {")[0]
    return sum(1 for line in text.splitlines() if line.strip() and not line.strip().startswith("//"))


def main():
    root = sys.argv[1] if len(sys.argv) > 1 else os.path.join(os.path.dirname(__file__), "../../src")
    lines, files = collections.Counter(), collections.Counter()
    for folder, _, names in os.walk(root):
        for name in names:
            if name.endswith(".rs"):
                floor = os.path.relpath(os.path.join(folder, name), root).split(os.sep)[0]
                floor = "crate" if floor.endswith(".rs") else floor
                files[floor] += 1
                if not name.endswith("tests.rs"):
                    with open(os.path.join(folder, name), encoding="utf-8") as file:
                        lines[floor] += code(file.read())
    for floor, count in lines.most_common():
        print(f"{floor:10} {count:6} lines, {files[floor]:4} files")
    print(f"{'all':10} {lines.total():6} lines, {files.total():4} files")


main()
