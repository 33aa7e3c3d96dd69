"""Counts what the crate shows: python3 tests/scripts/public_items.py [--list]

Counted are modules, items (functions, types, traits, constants) and inherent methods that a path of public modules and re-exports leads to.
What `#[doc(hidden)]` hides is not: it is there for the program, its tests and its benchmarks. Pages of documentation are not items.
"""

import collections
import os
import re
import sys

KINDS = r"pub (?:const |unsafe |async )*(fn|struct|enum|trait|type|const|static|union)\s+(\w+)"
# Items, and types that stand indented in the body or the call of a macro.
ITEM = re.compile(r"((?:^ *#\[[^\n]*\]\n)*)^(?:" + KINDS + r"| +pub (struct|enum|trait|type|union)\s+(\w+))", re.M)
METHOD = re.compile(r"((?:^    #\[[^\n]*\]\n)*)^    pub (?:const |unsafe |async )*fn (\w+)", re.M)
IMPL = re.compile(r"^impl(?:<(?:[^<>]|<[^<>]*>)*>)?\s+(\w+)(?:<[^{]*>)?\s*(?:where[^{]*)?\{", re.M)
ATTRIBUTES = r"((?:^#\[[^\n]*\]\n)*)"


def stripped(text):
    """Source without comments, literals and unit tests."""
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text, flags=re.S)
    tests = text.find("#[cfg(test)]\nmod tests {")
    return text if tests < 0 else text[:tests]


def read(roots):
    """Sources by their modules; the last root is that of the package whose surface is counted, those before are what it leans on."""
    files = {"": ""}
    for root in roots:
        for folder, _, names in os.walk(root):
            for name in (name for name in names if name.endswith(".rs") and name != "main.rs"):
                module = os.path.relpath(os.path.join(folder, name), root)[:-3].replace("/", "::")
                with open(os.path.join(folder, name), encoding="utf-8") as file:
                    text = stripped(file.read())
                if module != "lib":
                    files[re.sub(r"::mod$", "", module)] = text
                else:
                    files[""] += text if root == roots[-1] else text.replace("pub use", "pub(crate) use")
    return files


def leaves(prefix, tree):
    """Paths of a `use` tree, each with the name it gets."""
    tree = tree.strip()
    group = re.match(r"^((?:\w+::)*)\{(.*)\}$", tree, re.S)
    if not group:
        path, _, name = tree.partition(" as ")
        path = prefix + path.strip().split("::")
        return [(path, name.strip() or path[-1])]
    found, depth, part = [], 0, ""
    for c in group.group(2) + ",":
        depth += (c == "{") - (c == "}")
        if c == "," and depth == 0:
            found += leaves(prefix + group.group(1).split("::")[:-1], part) if part.strip() else []
            part = ""
        else:
            part += c
    return found


class Surface:
    def __init__(self, files):
        self.files, self.modules, self.items = files, set(), set()
        self.own, self.hidden = {}, {}
        for module, text in files.items():
            found = [(attributes, kind or indented, name or type_) for attributes, kind, name, indented, type_ in ITEM.findall(text)]
            self.own[module] = {name: kind for attributes, kind, name in found if "doc(hidden)" not in attributes}
            self.hidden[module] = {name for attributes, _, name in found if "doc(hidden)" in attributes}
        self.show("")

    def below(self, module, name):
        return f"{module}::{name}" if module else name

    def uses(self, module, hidden):
        for attributes, scope, tree in re.findall(ATTRIBUTES + r"^pub(\([^)]*\))? use ([^;]*);", self.files[module], re.M):
            if hidden or not (scope or "doc(hidden)" in attributes):
                yield from leaves([], re.sub(r"\s+", " ", tree))

    def resolve(self, path, module):
        if path[0] in ("crate", "lnn_engine"):
            module, path = "", path[1:]
        while path and path[0] in ("self", "super"):
            module = "::".join(module.split("::")[:-1]) if path[0] == "super" else module
            path = path[1:]
        while path and self.below(module, path[0]) in self.files:
            module, path = self.below(module, path[0]), path[1:]
        if module == "" and path:
            # A name of the facade stands for the module behind it.
            for origin, known in self.uses("", True):
                if known == path[0] and origin[0] != known:
                    return self.resolve(origin + path[1:], "")
        return module, path

    def export(self, module, path, depth=0):
        name = path[0]
        if name in self.own.get(module, ()):
            self.items.add((module, name))
        elif depth < 8 and module in self.files and name not in self.hidden[module]:
            origins = [self.resolve(path, module) for path, known in self.uses(module, True) if known == name]
            for origin, rest in origins:
                if rest:
                    self.export(origin, rest, depth + 1)
            if not origins and len(path) == 1:
                # The macro of another module made it.
                self.own[module][name] = "type"
                self.items.add((module, name))

    def show(self, module):
        if module in self.modules:
            return
        self.modules.add(module)
        self.items |= {(module, name) for name in self.own[module]}
        for attributes, name in re.findall(ATTRIBUTES + r"^pub mod (\w+);", self.files[module], re.M):
            if "doc(hidden)" not in attributes and self.below(module, name) in self.files:
                self.show(self.below(module, name))
        for path, _ in self.uses(module, False):
            origin, rest = self.resolve(path, module)
            if rest:
                self.export(origin, rest)
            else:
                self.show(origin)

    def room(self, module):
        """Floor and module of a file."""
        return "::".join(module.split("::")[:2])

    def methods(self):
        """Public methods of the types shown, by room, as paths; a type's methods stand in its own room."""
        kinds = ("struct", "enum", "type", "trait")
        types = {(self.room(module), name) for module, name in self.items if self.own[module][name] in kinds}
        shown = []
        for module, text in self.files.items():
            room = self.room(module)
            for found in IMPL.finditer(text):
                if (room, found.group(1)) in types:
                    depth, end = 0, found.end() - 1
                    while True:
                        depth += (text[end] == "{") - (text[end] == "}")
                        end += 1
                        if depth == 0:
                            break
                    methods = METHOD.findall(text[found.end() : end])
                    names = [name for attributes, name in methods if "doc(hidden)" not in attributes]
                    shown += [(room, f"{module}::{found.group(1)}::{name}") for name in names]
        return shown


def main():
    top = os.path.join(os.path.dirname(__file__), "../..")
    surface = Surface(read([os.path.join(top, "crates/lnn-engine/src"), os.path.join(top, "src")]))
    modules, items, methods = len(surface.modules) - 1, len(surface.items), surface.methods()
    print(f"{modules + items + len(methods)} public: {modules} modules, {items} items, {len(methods)} methods")
    per_room = collections.Counter(room for room, _ in methods)
    rooms = collections.Counter(surface.room(module) for module, _ in surface.items)
    print(", ".join(f"{room or 'crate'} {count} + {per_room[room]}" for room, count in rooms.most_common()))
    if "--list" in sys.argv:
        print("\n".join(sorted([f"{module}::{name}" for module, name in surface.items] + [path for _, path in methods])))


main()
