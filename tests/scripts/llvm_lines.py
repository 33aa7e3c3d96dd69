"""Counts what the compiler is given: python3 tests/scripts/llvm_lines.py FILE.ll [--depth N] [--top N]

The file is made, without optimisation, by
    cargo rustc --release --lib -- --emit=llvm-ir -C no-prepopulate-passes -C codegen-units=1 -C symbol-mangling-version=v0
and lies in target/release/deps. A function counts for the first module of ours that its name holds, be it in the type of a closure (an iterator's
`fold` over a closure of `lnn::linalg` is made for `lnn::linalg`), otherwise for its crate. Needs `c++filt`.
"""

import argparse
import collections
import re
import subprocess


def functions(file):
    """Symbol and number of lines of every function."""
    symbol, count = None, 0
    for line in file:
        if symbol is None and line.startswith("define "):
            symbol, count = re.search(r'@"?([\w.$]+)', line).group(1), 0
        if symbol is not None:
            count += 1
            if line.startswith("}"):
                yield symbol, count
                symbol = None


def without_types(name):
    """Name with its generic arguments left out, to count copies of one function together."""
    kept, depth = [], 0
    for at, c in enumerate(name):
        if c == "<" and name[at - 2:at] == "::":
            depth += 1
        elif c == ">" and depth and name[at - 1] != "-":
            depth -= 1
        elif c == "<" and depth:
            depth += 1
        elif not depth:
            kept.append(c)
    return "".join(kept)


def owner(name, depth):
    ours = re.search(r"\blnn(::\w+)+", name)
    if ours:
        return "::".join(ours.group().split("::")[:depth])
    return re.search(r"\w+", name).group()


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("file")
    options.add_argument("--depth", type=int, default=2, help="names of a module's path to tell modules by")
    options.add_argument("--top", type=int, default=40, help="rows of a table")
    options = options.parse_args()
    with open(options.file, encoding="utf-8", errors="replace") as file:
        found = list(functions(file))
    names = subprocess.run(["c++filt"], input="\n".join(symbol for symbol, _ in found), capture_output=True, text=True, check=True)
    names = re.sub(r"\[[0-9a-f]{8,}\]", "", names.stdout).splitlines()
    total = sum(count for _, count in found)
    tables = [(collections.Counter(), collections.Counter()) for _ in range(2)]
    for name, (_, count) in zip(names, found):
        for (lines, copies), row in zip(tables, (owner(name, options.depth), without_types(name))):
            lines[row] += count
            copies[row] += 1
    print(f"{total} lines in {len(found)} copies of {len(tables[1][0])} functions")
    for lines, copies in tables:
        print()
        for row, count in lines.most_common(options.top):
            print(f"{count:9} {100 * count / total:5.1f} % {copies[row]:6} {row}")


if __name__ == "__main__":
    main()
