"""Writes the TypeScript modules of the web client: limits and table layouts."""

HEAD = "// Generated from {schema} by protocol/generator. Do not edit.\n"


def lower_camel(name):
    """max_items -> maxItems"""
    first, *rest = name.split("_")
    return first + "".join(word.capitalize() for word in rest)


class TypeScript:
    def __init__(self, schema):
        self.schema = schema

    def head(self):
        return HEAD.format(schema=self.schema.path)

    def limits(self):
        lines = []
        for f in self.schema.limits.values():
            if f.doc:
                lines.append("/** " + "\n * ".join(f.doc) + (" */" if len(f.doc) == 1 else "\n */"))
            lines.append(f"export const {lower_camel(f.name)} = {f.default};")
        return self.head() + "\n".join(lines) + "\n"

    def layout_of(self, f, numbers):
        """[kind, size or table number, alignment] of a field, see the generated comment."""
        inline = self.schema.inline_layout(f.type) if f.type != "string" else None
        if f.type == "string":
            return [1, 1, 1]
        if f.is_list:
            return [2, *inline] if inline else [4, numbers[f.type], 4]
        return [0, *inline] if inline else [3, numbers[f.type], 4]

    def layout(self):
        tables = [t for t in self.schema.tables.values() if not t.is_struct]
        numbers = {t.name: number for number, t in enumerate(tables)}
        rows = "".join(f"  // {t.name}\n  {[self.layout_of(f, numbers) for f in t.all_fields]},\n"
                       for t in tables)
        names = "".join(f"  {name}: {number},\n" for name, number in numbers.items())
        return (self.head() + """
/** Layout of a field: [kind, size or table number, alignment]. Kinds: 0 inline, 1 string, 2 vector
 * of inline elements, 3 table, 4 vector of tables. */
export type FieldLayout = readonly [kind: number, size: number, align: number];

export const tableNumbers = {
""" + names + """} as const;

export const tableLayouts: readonly (readonly FieldLayout[])[] = [
""" + rows + "];\n")
