"""Writes the TypeScript interfaces of the messages."""

import re
import textwrap

HEAD = "// Generated from {schema} by protocol/generator. Do not edit.\n"
ARRAYS = {"ubyte": "Uint8Array", "ushort": "Uint16Array", "uint": "Uint32Array",
          "float": "Float32Array", "double": "Float64Array"}


def lower_camel(name):
    """max_items -> maxItems, StepLeft -> stepLeft"""
    first, *rest = name.split("_")
    return first[:1].lower() + first[1:] + "".join(word.capitalize() for word in rest)


class TypeScript:
    def __init__(self, schema):
        self.schema = schema

    def head(self):
        return HEAD.format(schema=self.schema.path)

    # ---- names and types

    def name_of(self, f):
        """The name of a field in TypeScript. It is the name of the C++ member in camel case. If the
        member is a path, it is the name of the field."""
        cpp = f.get("cpp", "")
        return f.get("web") or lower_camel(cpp if cpp.isidentifier() else f.name)

    def interface_name(self, table):
        """The name of an interface. Messages have the names of the C++ structs, because JavaScript
        already has a class Error."""
        return table.get("cpp", table.name) if "message" in table else table.name

    def vector_of(self, f):
        """The property that contains the field, for members such as `min_m.x`, or None."""
        name, _, member = f.get("cpp", "").partition(".")
        return lower_camel(name) if member in ("x", "y", "z") else None

    def properties(self, table):
        """The fields of each property. The members of a vector are one property."""
        properties = {}
        for f in table.fields:
            properties.setdefault(self.vector_of(f) or self.name_of(f), []).append(f)
        return properties

    def is_tuple(self, table):
        """True for vectors and quaternions, which are arrays in TypeScript."""
        return table.is_struct and all(f.name in "xyzw" for f in table.fields)

    def only_member(self, table):
        """The member that stands for the whole table, or None. For example, a layer is its name."""
        return next((f for f in table.fields if f.get("cpp") == "."), None)

    def type_of(self, f):
        table = self.schema.tables.get(f.type)
        if table is not None and "web" in table:
            return table.get("web")
        if table is not None and self.is_tuple(table):
            name = f"readonly [{', '.join(['number'] * len(table.fields))}]"
        elif table is not None:
            member = self.only_member(table)
            name = self.type_of(member) if member else self.interface_name(table)
        elif f.get("enumerators") or f.type in self.schema.enums:
            name = f.get("enumerators") or f.type
        elif f.is_list:
            return ARRAYS[f.type]
        elif f.type in ("bool", "string"):
            name = {"bool": "boolean"}.get(f.type, f.type)
        else:
            name = "bigint" if f.type == "ulong" and "number" not in f else "number"
        if f.is_list:
            return f"readonly ({name})[]" if " " in name else f"readonly {name}[]"
        return name + (" | null" if "optional" in f or f.default == "null" else "")

    def words(self, lines, table=None):
        """The text of a comment, with the names of TypeScript, and the values of limits. `table` is
        the table whose fields the comment may mention."""
        names = {f.name: self.name_of(f) for f in table.fields} if table else {}
        text = re.sub(r"\bkMax(\w+)", lambda m: self.limit(m[1]) or m[0], " ".join(lines))
        text = re.sub(r"`(\w+)`", lambda m: f"`{names.get(m[1]) or lower_camel(m[1])}`", text)
        text = re.sub(r"\b(?:\w+::)?k([A-Z]\w+)", lambda m: f"`{self.value_name(m[1])}`", text)
        return text.replace("::", ".")

    def comment(self, lines, indent="", table=None):
        lines = textwrap.wrap(self.words(lines, table), 94 - len(indent))
        return f"{indent}/** {f'{chr(10)}{indent} * '.join(lines)} */\n" if lines else ""

    def value_name(self, name):
        """The name of an enumerator, or of a status code."""
        if any(name in enum.values for enum in self.schema.enums.values()):
            return lower_camel(name)
        return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()

    def limit(self, name):
        """The value of the limit that C++ calls kMaxNAME, or None."""
        snake = re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
        limit = self.schema.limits.get(f"max_{snake}")
        return limit and limit.default + (" bytes" if name.endswith("Bytes") else "")

    def interface(self, table):
        tag = f"  readonly type: '{table.name}';\n" if "message" in table else ""
        members = ""
        for name, fields in self.properties(table).items():
            types = [self.type_of(f) for f in fields]
            type_name = types[0] if len(types) == 1 else f"readonly [{', '.join(types)}]"
            members += (f"{self.comment(self.schema.documentation(fields[0]), '  ', table)}"
                        f"  readonly {name}: {type_name};\n")
        comment = self.comment(table.doc, table=table)
        return f"{comment}export interface {self.interface_name(table)} {{\n{tag}{members}}}\n"

    def enum_type(self, enum):
        """The type of an enum. The comment lists the values that have comments."""
        comment = self.comment(enum.doc)
        values = "".join(
            textwrap.fill(f"`{lower_camel(value)}`: {self.words(doc)}", 95,
                          initial_indent=" * - ", subsequent_indent=" *   ") + "\n"
            for value, doc in enum.value_docs.items() if doc)
        if comment and values:
            comment = f"/**\n * {comment[4:-4]}\n{values} */\n"
        return f"{comment}export type {enum.name} = (typeof enums.{enum.name})[number];\n"

    def messages(self):
        enums = "".join(
            f"  {e.name}: [{', '.join(repr(lower_camel(v)) for v in e.values)}],\n"
            for e in self.schema.enums.values())
        types = "".join(self.enum_type(e) for e in self.schema.enums.values())
        interfaces = "\n".join(
            self.interface(t) for t in self.schema.tables.values()
            if not self.is_tuple(t) and "web" not in t and not self.only_member(t))
        sent = {side: " |\n    ".join(self.interface_name(m) for m in self.schema.messages
                                      if m.get("sender") in (side, "both"))
                for side in ("client", "server")}
        types_of_messages = "".join(f"  {m.name}: {m.get('message')},\n"
                                    for m in self.schema.messages)
        return (self.head() + "import type {Parameters} from '../src/types';\n\n"
                f"/** Values of each enum, in the order of their numbers. */\n"
                f"export const enums = {{\n{enums}}} as const;\n{types}\n{interfaces}\n"
                f"export type ClientMessage =\n    {sent['client']};\n"
                f"export type ServerMessage =\n    {sent['server']};\n"
                "export type Message = ClientMessage | ServerMessage;\n\n"
                "/** Numbers of the message types. */\n"
                f"export const MessageType = {{\n{types_of_messages}}} as const;\n"
                "export type MessageName = keyof typeof MessageType;\n")
