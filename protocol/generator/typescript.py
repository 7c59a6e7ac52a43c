"""Writes the TypeScript modules of the web client: message interfaces and tables."""

import json
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
        """The name of a field in TypeScript: that of the C++ member, unless that is a path."""
        cpp = f.get("cpp", "")
        return f.get("web") or lower_camel(cpp if cpp.isidentifier() else f.name)

    def is_tuple(self, table):
        """True for vectors and quaternions, which are arrays in TypeScript."""
        return table.is_struct and all(f.name in "xyzw" for f in table.fields)

    def only_member(self, table):
        """The member that stands for the whole table, or None. For example, a layer is its name."""
        return next((f for f in table.fields if f.get("cpp") == "."), None)

    def type_of(self, f):
        table = self.schema.tables.get(f.type)
        if table is not None and table.get("native") == "ParameterSet":
            return "Parameters"
        if table is not None and self.is_tuple(table):
            name = f"readonly [{', '.join(['number'] * len(table.fields))}]"
        elif table is not None:
            member = self.only_member(table)
            name = self.type_of(member) if member else table.get("cpp", table.name)
        elif f.get("enumerators") or f.type in self.schema.enums:
            name = f.get("enumerators") or f.type
        elif f.is_list:
            return ARRAYS[f.type]
        elif f.type in ("bool", "string"):
            name = {"bool": "boolean"}.get(f.type, f.type)
        else:
            name = "bigint" if f.type == "ulong" and "number" not in f else "number"
        if f.is_list:
            return f"readonly ({name})[]" if " " in name else f"{name}[]"
        return name + (" | null" if "optional" in f or f.default == "null" else "")

    def documentation(self, f):
        """The comment of a field, with the values of limits instead of their names in C++."""
        text = re.sub(r"\bkMax(\w+)", lambda m: str(self.limit(m[1]) or m[0]), " ".join(f.doc))
        lines = textwrap.wrap(text, 92)
        return f"  /** {f'{chr(10)}   * '.join(lines)} */\n" if lines else ""

    def limit(self, name):
        """The value of the limit that C++ calls kMaxNAME."""
        snake = re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
        limit = self.schema.limits.get(f"max_{snake}")
        return limit and limit.default

    def interface(self, table):
        tag = f"  type: '{table.name}';\n" if "message" in table else ""
        members = "".join(f"{self.documentation(f)}  {self.name_of(f)}: {self.type_of(f)};\n"
                          for f in table.fields)
        return f"export interface {table.get('cpp', table.name)} {{\n{tag}{members}}}\n"

    def messages(self):
        enums = "".join(
            f"  {e.name}: [{', '.join(repr(lower_camel(v)) for v in e.values)}],\n"
            for e in self.schema.enums.values())
        types = "".join(f"export type {name} = (typeof enums.{name})[number];\n"
                        for name in self.schema.enums)
        interfaces = "\n".join(
            self.interface(t) for t in self.schema.tables.values()
            if not self.is_tuple(t) and t.get("native") is None and not self.only_member(t))
        sent = {side: " |\n    ".join(m.get("cpp", m.name) for m in self.schema.messages
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

    # ---- tables

    def layout_of(self, f, numbers):
        """[kind, size or table number, alignment] of a field, see FieldInfo."""
        inline = self.schema.inline_layout(f.type) if f.type != "string" else None
        if f.type == "string":
            return [1, 1, 1]
        if f.is_list:
            return [2, *inline] if inline else [4, numbers[f.type], 4]
        return [0, *inline] if inline else [3, numbers[f.type], 4]

    def field_info(self, f, numbers):
        info = {"name": self.name_of(f), "layout": self.layout_of(f, numbers), "type": f.type}
        if f.type in self.schema.tables:
            info["type"], info["table"] = "table", numbers[f.type]
        elif f.type in self.schema.enums:
            info["type"] = "ubyte"
        if enum := f.get("enumerators") or (f.type if f.type in self.schema.enums else None):
            info["values"] = [lower_camel(v) for v in self.schema.enums[enum].values]
        if f.is_list:
            info["list"] = True
        elif f.type in self.schema.enums:
            info["initial"] = self.schema.enums[f.type].values.get(f.default, 0)
        elif f.type not in self.schema.tables and f.type != "string":
            info["initial"] = None if f.default == "null" else float(f.default or 0)
        # generator/README.md lists the cases in which a property may be absent.
        if f.default or "only" in f or "optional" in f or (f.is_list and "min" not in f) or (
                f.type == "bool" and "inverted" not in f):
            info["absent"] = True
        table = self.schema.tables.get(f.type)
        if table is not None and table.get("native") == "ParameterSet":
            info["parameters"] = True
        if "only" in f:
            info["only"] = [lower_camel(name) for name in f.get("only").split()]
        for condition in ("with", "without"):
            if condition in f:
                info[condition] = lower_camel(f.get(condition))
        flags = ("deprecated", "inverted", "number", "optional", "shared")
        return info | {name: True for name in flags if name in f}

    def table_info(self, table, numbers):
        fields = [self.field_info(f, numbers) for f in table.all_fields]
        info = {"name": table.name, "fields": fields}
        if table.is_struct:
            info["struct"] = list(self.schema.inline_layout(table.name))
            at = 0
            for field in fields:
                _, size, align = field["layout"]
                field["at"] = at = -(-at // align) * align
                at += size
        if self.is_tuple(table):
            info["tuple"] = True
        if self.only_member(table):
            info["alone"] = True
        return info

    # ---- JSON of the test vectors

    def json_rules(self, f):
        rules = {"name": f.name}
        if "json_omit" in f:
            rules["omit"] = lower_camel(f.get("json_omit") or "")
        if "bytes" in f:
            rules["bytes"] = True
        table = self.schema.tables.get(f.type)
        if group := f.get("json_array"):
            rules["group"] = group
        elif "json_array" in f or (table is not None and "native" in table):
            rules["array"] = True
        return rules

    def json(self):
        rows = "".join(f"  {json.dumps([self.json_rules(f) for f in t.all_fields])},\n"
                       for t in self.schema.tables.values())
        return self.head() + """
/** How a field appears in the JSON of protocol/vectors. */
export interface JsonField {
  readonly name: string;
  /** The field is omitted if the property of this name is empty; '': if the field is empty. */
  readonly omit?: string;
  /** The bytes are hexadecimal digits. */
  readonly bytes?: boolean;
  /** The struct is an array of its numbers. */
  readonly array?: boolean;
  /** The fields of the same group are an array of this name. */
  readonly group?: string;
}

/** The fields of each table, in the order of `tables`. */
export const jsonFields: readonly (readonly JsonField[])[] = [
""" + rows + "];\n"

    def tables(self):
        numbers = {name: number for number, name in enumerate(self.schema.tables)}
        rows = "".join(f"  {json.dumps(self.table_info(t, numbers))},\n"
                       for t in self.schema.tables.values())
        names = "".join(f"  {name}: {number},\n" for name, number in numbers.items())
        return self.head() + """
/** A field of a table or struct. */
export interface FieldInfo {
  readonly name: string;
  /** [kind, size or table number, alignment]. Kinds: 0 inline, 1 string, 2 vector of inline
   * elements, 3 table, 4 vector of tables. */
  readonly layout: readonly [kind: number, size: number, align: number];
  /** Type of the field, or of the entries of its list: a scalar, `string` or `table`. */
  readonly type: string;
  /** Number of the table or struct. */
  readonly table?: number;
  /** Names of the values of an enum. */
  readonly values?: readonly string[];
  readonly list?: boolean;
  /** Value of an absent number. */
  readonly initial?: number | null;
  /** Reserved: neither read nor written. */
  readonly deprecated?: boolean;
  /** The property is the opposite of the field. */
  readonly inverted?: boolean;
  /** The 64-bit integer is a number instead of a bigint. */
  readonly number?: boolean;
  /** The table may be absent; it is then null. */
  readonly optional?: boolean;
  /** The property may be absent. The field then has its initial value. */
  readonly absent?: boolean;
  /** Values of the field `type` that use the field. It is absent for others. */
  readonly only?: readonly string[];
  /** Name of a property without which the field is not used. */
  readonly with?: string;
  /** Name of a property with which the field is not used. */
  readonly without?: string;
  /** The list is an object of parameters. */
  readonly parameters?: boolean;
  /** Equal texts of a message are stored once. */
  readonly shared?: boolean;
  /** Position in a struct. */
  readonly at?: number;
}

export interface TableInfo {
  readonly name: string;
  readonly fields: readonly FieldInfo[];
  /** Size and alignment, if it is a struct. */
  readonly struct?: readonly [size: number, align: number];
  /** The struct is an array of its numbers. */
  readonly tuple?: boolean;
  /** The table is represented by its only field. */
  readonly alone?: boolean;
}

/** Indices of `tables`. */
export const tableNumbers = {
""" + names + """} as const;

export const tables = [
""" + rows + "] as unknown as readonly TableInfo[];\n"
