#!/usr/bin/env python3
"""Generates code from the schema of the protocol: generate.py SCHEMA KIND FOLDER.

KIND is one of:
  flatc   the schema with declarations of its attributes, for flatc
  cpp     limits.h, message_type.h, message_structs.h, message_list.h, codec.h and codec.cpp
  client  client/request_from_c.h, for the C API of the client
  json    fields_json.h and fields_json.cpp, for the test vectors
  web     messages.ts and codec.ts for the web client, and json.ts for its tests

Files whose content does not change are not written, so that nothing is compiled again.
"""

import pathlib
import sys

from c_api import CApi
from cpp import Cpp
from cpp_json import CppJson
from schema import Schema, SchemaError
from typescript_codec import TypeScriptCodec


def files(schema, kind):
    if kind == "flatc":
        return {schema.path: schema.for_flatc()}
    if kind == "cpp":
        cpp = Cpp(schema)
        return {"include/stridewire/protocol/limits.h": cpp.limits_header(),
                "include/stridewire/protocol/message_type.h": cpp.message_type_header(),
                "include/stridewire/protocol/message_structs.h": cpp.structs_header(),
                "message_list.h": cpp.message_list(),
                "codec.h": cpp.codec_header(),
                "codec.cpp": cpp.codec_source()}
    if kind == "json":
        json = CppJson(schema)
        return {"fields_json.h": json.header(), "fields_json.cpp": json.source()}
    if kind == "client":
        return {"client/request_from_c.h": CApi(schema).header()}
    if kind == "web":
        web = TypeScriptCodec(schema)
        return {"messages.ts": web.messages(), "codec.ts": web.codec(), "json.ts": web.json()}
    sys.exit(f"generate.py: unknown kind '{kind}'\n{__doc__}")


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    path, kind, folder = sys.argv[1:]
    try:
        schema = Schema(pathlib.Path(path).name, pathlib.Path(path).read_text(encoding="utf-8"))
    except (OSError, SchemaError) as error:
        sys.exit(f"generate.py: {error}")
    for name, text in files(schema, kind).items():
        out = pathlib.Path(folder) / name
        out.parent.mkdir(parents=True, exist_ok=True)
        if not out.exists() or out.read_text(encoding="utf-8") != text:
            out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
