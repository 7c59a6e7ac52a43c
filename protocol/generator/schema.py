"""Reads the subset of the FlatBuffers schema language that protocol/schema uses.

Every declaration stores its line, so that errors name file, line and field. This module checks the
attributes itself, because flatc accepts every declared attribute anywhere.
"""

import re
from dataclasses import dataclass, field, replace

# Sizes in bytes.
SCALARS = {"bool": 1, "byte": 1, "ubyte": 1, "short": 2, "ushort": 2, "int": 4, "uint": 4,
           "float": 4, "long": 8, "ulong": 8, "double": 8}

TABLE_ATTRIBUTES = {
    "bulk", "cpp", "handwritten", "in_order", "meaning", "message", "native", "reversed", "sender",
    "variant", "web",
}
FIELD_ATTRIBUTES = {
    "above", "below", "borrowed", "bytes", "count", "cpp", "deprecated", "early", "enumerators",
    "group", "initial", "inverted", "json_array", "json_omit", "json_place", "keep_empty",
    "keys", "max", "min", "min_or_none", "needed", "nonzero", "number", "omit_zero", "only",
    "optional", "per", "requires", "shared", "status", "web", "with", "without",
}
ENUM_ATTRIBUTES = {"cpp", "handwritten"}


class SchemaError(Exception):
    """A schema that the generator cannot use. The text begins with "file:line: "."""


@dataclass
class Enum:
    name: str
    attributes: dict
    line: int
    doc: list
    values: dict = field(default_factory=dict)  # Name: number.
    value_docs: dict = field(default_factory=dict)


@dataclass
class Field:
    name: str
    type: str  # Name of the type; of the entries if is_list.
    is_list: bool
    default: str | None
    attributes: dict
    line: int
    doc: list

    def __contains__(self, attribute):
        return attribute in self.attributes

    def get(self, attribute, default=None):
        return self.attributes.get(attribute, default)


@dataclass
class Table:
    """A table, or a struct if is_struct."""

    name: str
    is_struct: bool
    attributes: dict
    line: int
    doc: list
    all_fields: list = field(default_factory=list)  # Also deprecated fields, which take space.

    def __contains__(self, attribute):
        return attribute in self.attributes

    def get(self, attribute, default=None):
        return self.attributes.get(attribute, default)

    @property
    def fields(self):
        return [f for f in self.all_fields if "deprecated" not in f]


class Schema:
    def __init__(self, path, text):
        self.path = path
        self.text = text
        self.enums = {}
        self.tables = {}
        self.limits = {}  # Name of a limit: the Field that declares it.
        self._parse(text)
        if "Limits" in self.tables:
            self.limits = {f.name: f for f in self.tables.pop("Limits").all_fields}
        self._check()

    def fail(self, line, text):
        raise SchemaError(f"{self.path}:{line}: {text}")

    def for_flatc(self):
        """The schema with declarations of the attributes, which flatc requires."""
        attributes = TABLE_ATTRIBUTES | FIELD_ATTRIBUTES | ENUM_ATTRIBUTES
        declarations = "".join(f'attribute "{name}";\n'
                               for name in sorted(attributes - {"deprecated"}))
        return f"// Generated from {self.path} by protocol/generator.\n{declarations}\n{self.text}"

    @property
    def messages(self):
        """Tables that are messages, in the order of the schema."""
        return [t for t in self.tables.values() if "message" in t]

    def number(self, value):
        """The value of a bound, which is a number or the name of a limit."""
        return int(self.limits[value].default) if value in self.limits else float(value)

    def documentation(self, f):
        """The lines of the comment of a field, with its range at the end."""
        def name(value):
            if value in self.limits:
                return "k" + "".join(word.capitalize() for word in value.split("_"))
            return value if self.is_constant(value) else f"`{value}`"

        low, high = f.get("min"), f.get("max")
        unit = " entries" if f.is_list and "bytes" not in f else ""
        if f.type in self.enums or "per" in f or low == "-1":
            text = ""
        elif low and high:
            text = f"{name(low)} to {name(high)}{unit}."
        elif low or high:
            text = f"At least {name(low)}." if low else f"At most {name(high)}{unit}."
        elif "above" in f or "below" in f:
            text = f"Above {name(f.get('above'))}." if "above" in f else \
                f"Below {name(f.get('below'))}."
        elif "keys" in f and not f.is_list:
            text = f"A {f.get('keys')}."
        else:
            text = "Not 0." if "nonzero" in f and not f.is_list else ""
        if not text or not f.doc:
            return f.doc + [text] if text else f.doc
        joined = f"{f.doc[-1]} {text}"
        return f.doc[:-1] + [joined] if len(joined) <= 90 else f.doc + [text]

    def keys(self, f):
        """The field itself, or the members of the entries of its list, that are unique."""
        fields = self.tables[f.type].fields if f.type in self.tables else [f]
        return [each for each in fields if "keys" in each]

    def is_constant(self, value):
        """Whether a bound is a number or a limit. Otherwise it is a field of the same table."""
        return value in self.limits or bool(re.fullmatch(r"-?\d+(\.\d+)?", value))

    def is_struct(self, type_name):
        return type_name in self.tables and self.tables[type_name].is_struct

    def inline_layout(self, type_name):
        """Size and alignment of a type that is stored inline, or None for an offset."""
        if type_name in self.enums:
            return 1, 1
        if type_name in SCALARS:
            return SCALARS[type_name], SCALARS[type_name]
        if not self.is_struct(type_name):
            return None
        size, align = 0, 1
        for part in self.tables[type_name].all_fields:
            part_size, part_align = self.inline_layout(part.type)
            size = -(-size // part_align) * part_align + part_size
            align = max(align, part_align)
        return -(-size // align) * align, align

    def alternatives(self, table):
        """The alternatives of a table with the attribute `variant`: for each value of its field
        `type` a table with the fields that the value uses."""
        enum = self.enums[next(f.type for f in table.fields if f.name == "type")]
        tables = []
        for value in enum.values:
            fields = [f for f in table.fields if value in f.get("only", "").split()]
            names = [f.name for f in fields]
            tables.append(Table(value + table.get("variant").capitalize(), False, {}, table.line,
                                enum.value_docs[value],
                                [self._used_by(f, value, names) for f in fields]))
        return tables

    def _used_by(self, f, value, names):
        """Copies a field without the conditions that cannot apply for this value of `type`."""
        needed = value in f.get("needed", "").split()
        attributes = {name: text for name, text in f.attributes.items()
                      if not (needed and name in ("json_omit", "optional", "with", "without"))
                      and not (name in ("with", "without") and text not in names)}
        return replace(f, default=None if needed else f.default, attributes=attributes)

    # ---- parsing

    def _parse(self, text):
        doc = []
        body = None  # The declaration whose braces are open.
        statement, start = "", 0
        for line, raw in enumerate(text.split("\n"), 1):
            if match := re.match(r"\s*///\s?(.*)", raw):
                doc.append(match[1])
                continue
            for part in re.split(r"([{};,])", re.sub(r"//.*", "", raw)):
                ends_value = part == "," and isinstance(body, Enum)
                if part not in ("{", "}", ";") and not ends_value:
                    start = start if statement.strip() else line
                    statement += part + " "
                    continue
                words, statement = statement.strip(), ""
                if part == "{":
                    body = self._declaration(words, start, doc)
                elif part == ";" or (isinstance(body, Enum) and words):
                    self._statement(body, words, start, doc)
                elif words:
                    self.fail(start, f"expected ';' after '{words}'")
                body = None if part == "}" else body
                doc = []
        if statement.strip() or body:
            self.fail(start, "the declaration does not end")

    def _attributes(self, text, allowed, line, where):
        attributes = {}
        for part in re.findall(r'(?:[^,"]|"[^"]*")+', text or ""):
            match = re.fullmatch(r'\s*(\w+)\s*(?::\s*"([^"]*)")?\s*', part)
            if not match:
                self.fail(line, f"{where}: cannot read the attribute '{part.strip()}'")
            if match[1] not in allowed:
                self.fail(line, f"{where}: unknown attribute '{match[1]}'; expected one of "
                                f"{', '.join(sorted(allowed))}")
            attributes[match[1]] = match[2] or ""
        return attributes

    def _declaration(self, text, line, doc):
        match = re.fullmatch(r"(table|struct|enum)\s+(\w+)\s*(?::\s*(\w+)\s*)?(?:\((.*)\))?",
                             text, re.S)
        if not match:
            self.fail(line, f"expected a table, struct or enum, got '{text}'")
        kind, name, base, attributes = match.groups()
        if kind == "enum":
            if base != "ubyte":
                self.fail(line, f"enum {name}: expected the type ubyte, got '{base}'")
            attributes = self._attributes(attributes, ENUM_ATTRIBUTES, line, f"enum {name}")
            return self.enums.setdefault(name, Enum(name, attributes, line, doc))
        attributes = self._attributes(attributes, TABLE_ATTRIBUTES, line, f"{kind} {name}")
        return self.tables.setdefault(name, Table(name, kind == "struct", attributes, line, doc))

    def _statement(self, body, text, line, doc):
        if body is None:
            if not re.fullmatch(r'namespace\s+[\w.]+|attribute\s+"\w+"', text):
                self.fail(line, f"expected a declaration, got '{text}'")
        elif isinstance(body, Enum):
            match = re.fullmatch(r"(\w+)\s*=\s*(\d+)", text)
            position = len(body.values)
            if not match or int(match[2]) != position:
                self.fail(line, f"enum {body.name}: expected '{position}' for the value "
                                f"number {position}, got '{text}'")
            body.values[match[1]] = position
            body.value_docs[match[1]] = doc
        else:
            match = re.fullmatch(r"(\w+)\s*:\s*(\[)?\s*(\w+)\s*\]?\s*(?:=\s*([-\w.]+)\s*)?"
                                 r"(?:\((.*)\))?", text, re.S)
            if not match:
                self.fail(line, f"{body.name}: cannot read the field '{text}'")
            name, is_list, type_name, default, attributes = match.groups()
            attributes = self._attributes(attributes, FIELD_ATTRIBUTES, line, f"{body.name}.{name}")
            body.all_fields.append(
                Field(name, type_name, bool(is_list), default, attributes, line, doc))

    # ---- checks of what was read

    def _check(self):
        for table in self.tables.values():
            for f in table.all_fields:
                self._check_field(f, f"{table.name}.{f.name}", table)
                names = [each.name for each in table.fields]
                others = [f.get(attribute) for attribute in
                          ("with", "without", "keep_empty", "per", "requires")]
                for other in others + f.get("count", "").split(" * "):
                    if other and other not in names:
                        self.fail(f.line, f"{table.name}.{f.name}: there is no field '{other}'")

    def _check_field(self, f, where, table):
        is_object = f.type in self.tables
        if not (f.type in SCALARS or f.type in self.enums or is_object or f.type == "string"):
            self.fail(f.line, f"{where}: unknown type '{f.type}'")
        if f.is_list and f.type == "string":
            self.fail(f.line, f"{where}: lists of strings are not supported")
        # Without an upper bound a small frame could decode to any amount of memory.
        if (f.is_list or f.type == "string") and "max" not in f:
            self.fail(f.line, f"{where}: a list or text needs the attribute 'max'")
        if is_object and not f.is_list and ("min" in f or "max" in f):
            self.fail(f.line, f"{where}: 'min' and 'max' do not apply to a table or struct")
        for attribute in ("enumerators", "keys"):
            if attribute in f and f.get(attribute) not in self.enums:
                self.fail(f.line, f"{where}: unknown enum '{f.get(attribute)}'")
        for bound in ("min", "max", "above", "below", "min_or_none"):
            value = f.get(bound)
            if value is None:
                continue
            if f.type in self.enums and not f.is_list:
                if value not in self.enums[f.type].values:
                    self.fail(f.line, f"{where}: {bound}: {f.type} has no enumerator '{value}'")
            elif not self.is_constant(value) and (
                    f.is_list or bound not in ("max", "below") or
                    value not in [each.name for each in table.fields]):
                self.fail(f.line, f"{where}: {bound}: expected a number or a field of Limits, "
                                  f"got '{value}'")
