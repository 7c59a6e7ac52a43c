"""Extracts the prose of a checkout: comments, messages, sentences of documents, text of pages.

`.ci/prose` checks this prose, and `prose_sample.py` draws random samples of it.
"""
import bisect
import os
import re
import subprocess
from collections import namedtuple

# kind: comment, header (comment of a public C or C++ header), message (a string literal that is a
#       phrase), sentence or heading (of a Markdown page) or ui (text of an HTML page).
# line: the number of the first line.
# code: the code before a trailing comment, or else the first line of code after the comment.
Text = namedtuple('Text', 'kind path line text code')

C_LIKE = ('.h', '.hpp', '.inl', '.c', '.cc', '.cpp', '.ts', '.js', '.mjs', '.cs', '.fbs', '.css')
SCRIPT = ('.ts', '.js', '.mjs')
HASH = ('.sh', '.py', '.cmake', '.toml', '.yml', '.yaml', '.service', '.conf')
HASH_NAMES = ('CMakeLists.txt', 'Dockerfile', '.clang-tidy', '.clang-format', '.gitignore')
# Third-party files and data. Generated files are not tracked by git.
EXCLUDED = re.compile(
    r'(^|/)(node_modules|third_party|vectors)/|package-lock\.json$|\.(svg|csv|bvh|swl|webp)$')
TESTS = re.compile(r'(^|/)tests?/')

# The alternatives are all tokens that can contain the first characters of another token.
TOKENS = r'''
    (?P<raw>R"(?P<delimiter>[^()\s\\]{0,16})\(.*?\)(?P=delimiter)")
  | (?P<string>"(?:\\.|[^"\\\n])*")
  | (?P<char>(?<![0-9A-Fa-f])'(?:\\.|[^'\\\n])*')
  | (?P<template>`(?:\\.|[^`\\])*`)
  | (?P<line>//[^\n]*)
  | (?P<block>/\*.*?\*/)
'''
# In scripts, a slash starts a regular expression if it follows a character that cannot end an
# operand.
REGEX_TOKEN = r'''
    (?P<regex>(?<=[(,=:\[!&|?{};])\s*/(?![/*])(?:\\.|\[(?:\\.|[^\]\\\n])*\]|[^/\\\n\[])+/[a-z]*) |
'''
C_TOKEN = re.compile(TOKENS, re.S | re.X)
SCRIPT_TOKEN = re.compile(REGEX_TOKEN + TOKENS, re.S | re.X)
DIRECTIVE = re.compile(
    r'^\s*(NOLINT|clang-format|IWYU|eslint|@ts-|prettier|#\s*region|SPDX|namespace\b|!)', re.I)
SHELL_MESSAGE = re.compile(r'\b(?:echo|printf|fail|die|bad_usage|warn)\b[^"\n]*"([^"\n]*)"')
HTML_TEXT = re.compile(
    r'\b(?:title|aria-label|placeholder|alt|content)="([^"]+)"|>([^<>]*[A-Za-z][^<>]*)<')


def files(root):
    """Lists the files of a checkout that git does not ignore, sorted.

    Without git, lists all files that are not in `build`.
    """
    listing = subprocess.run(
        ['git', '-C', root, 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
        capture_output=True, text=True)
    if listing.returncode == 0:
        found = listing.stdout.split('\0')
    else:
        found = [os.path.relpath(os.path.join(folder, name), root)
                 for folder, _, names in os.walk(root) for name in names]
        found = [path for path in found if not path.startswith(('build/', '.git/'))]
    return sorted({path for path in found
                   if os.path.isfile(os.path.join(root, path)) and not EXCLUDED.search(path)})


def read(root, path):
    """Returns the text of a file, or None if it is not valid UTF-8."""
    try:
        with open(os.path.join(root, path), encoding='utf-8') as file:
            return file.read()
    except UnicodeDecodeError:
        return None


def is_test(path):
    return TESTS.search(path) is not None


def is_public_header(path):
    return path.endswith(('.h', '.hpp')) and '/include/' in '/' + path and not is_test(path)


def strip_comment(token):
    """Removes the comment signs from a comment."""
    if token.startswith('/*'):
        text = re.sub(r'^/\*[*!]?<?|\*/$', '', token)
        return re.sub(r'^[ \t]*\*(?=[ \t\n/]|$)', '', text, flags=re.M)
    return re.sub(r'^//[/!]?<?', '', token)


def unescape(literal):
    replace = lambda m: {'n': '\n', 't': ' '}.get(m[1], m[1])
    return re.sub(r'\\(.)', replace, literal, flags=re.S)


def is_phrase(literal):
    """Returns whether a string literal is prose: at least three words, and mostly letters."""
    words = re.findall(r"[A-Za-z']+", literal)
    letters = sum(c.isalpha() or c == ' ' for c in literal)
    return (len(words) >= 3 and sum(len(word) > 1 for word in words) >= 2 and ' ' in literal and
            not re.match(r'\s*[<{(]\w*[>})]|^[\w./-]+$', literal) and letters > 0.7 * len(literal))


def c_like(path, source):
    """Yields the comments and phrases of C, C++, TypeScript, CSS and FlatBuffers sources."""
    ends = [m.end() for m in re.finditer(r'\n', source)]
    line_of = lambda offset: bisect.bisect_right(ends, offset) + 1
    lines = source.split('\n')
    is_script = path.endswith(SCRIPT)
    comments = []  # [first line, last line, column, text, is trailing, token type]
    strings = []   # (start offset, end offset, text)
    for m in (SCRIPT_TOKEN if is_script else C_TOKEN).finditer(source):
        what = 'raw' if m.lastgroup == 'delimiter' else m.lastgroup
        token = m[0]
        if what in ('line', 'block'):
            first, last = line_of(m.start()), line_of(m.end() - 1)
            begin = ends[first - 2] if first > 1 else 0
            column = m.start() - begin
            trailing = source[begin:m.start()].strip() != ''
            text = strip_comment(token)
            previous = comments[-1] if comments else None
            # Line comments in the same column of consecutive lines are one comment.
            if (previous and what == previous[5] == 'line' and first == previous[1] + 1 and
                    column == previous[2] and not trailing):
                previous[1], previous[3] = last, previous[3] + '\n' + text
            else:
                comments.append([first, last, column, text, trailing, what])
        elif what in ('raw', 'string', 'template') or (what == 'char' and is_script):
            if what == 'raw':
                body = token[token.index('(') + 1:token.rindex(')')]
            else:
                body = unescape(token[1:-1])
            if what == 'template':
                body = re.sub(r'\$\{[^{}]*\}', '0', body)
            # Adjacent literals are one text. Scripts join them with a plus sign.
            if strings and re.fullmatch(r'[\s+]*', source[strings[-1][1]:m.start()]):
                strings[-1] = (strings[-1][0], m.end(), strings[-1][2] + body)
            else:
                strings.append((m.start(), m.end(), body))
    kind = 'header' if is_public_header(path) else 'comment'
    for first, last, _, text, trailing, _ in comments:
        if DIRECTIVE.match(text) or not re.search(r'[A-Za-z]{2}', text):
            continue
        if trailing:
            code = lines[first - 1].split('//')[0].split('/*')[0].strip()
        else:
            code = next((line.strip() for line in lines[last:last + 3] if line.strip()), '')
        yield Text(kind, path, first, text.strip('\n').rstrip(), code)
    for start, _, body in strings:
        if is_phrase(body):
            line = line_of(start)
            yield Text('message', path, line, body, lines[line - 1].strip())


def hash_comments(path, source):
    """Yields the comments of scripts, CMake files and configuration, and messages of scripts."""
    comments = []  # [first line, last line, text, is trailing]
    for number, line in enumerate(source.split('\n'), 1):
        m = re.match(r'''((?:[^#"']|"[^"]*"|'[^']*'|\S#)*?)(?<!\S)#(.*)''', line)
        if not m or (number == 1 and line.startswith('#!')):
            continue
        text, trailing = m[2], m[1].strip() != ''
        previous = comments[-1] if comments else None
        if previous and previous[1] == number - 1 and not trailing and not previous[3]:
            previous[1], previous[2] = number, previous[2] + '\n' + text
        else:
            comments.append([number, number, text, trailing])
    for first, _, text, _ in comments:
        if re.search(r'[A-Za-z]{2}', text) and not re.match(r'\s*shellcheck', text):
            yield Text('comment', path, first, text.strip('\n').rstrip(), '')
    if path.endswith('.sh') or source.startswith('#!'):
        for number, line in enumerate(source.split('\n'), 1):
            for message in SHELL_MESSAGE.findall(line):
                if is_phrase(message):
                    yield Text('message', path, number, message, line.strip())
    if path.endswith('.py') or source.startswith('#!/usr/bin/env python3'):
        for m in re.finditer(r'^ *"""(.+?)"""', source, re.S | re.M):
            yield Text('comment', path, source.count('\n', 0, m.start()) + 1, m[1].strip(), '')


def split_sentences(text):
    parts = re.split(r'(?<=[.!?:])\s+(?=[A-Z"“(\[`*])|\n\n', text)
    return [part.strip() for part in parts if part.strip()]


def markdown(path, source):
    """Yields headings and the sentences of paragraphs, lists and tables, but no code blocks."""
    paragraph, start, fence = [], 0, False

    def flush():
        text = ' '.join(paragraph)
        paragraph.clear()
        return [Text('sentence', path, start, s, '') for s in split_sentences(text)]

    for number, line in enumerate(source.split('\n'), 1):
        text = line.strip()
        if re.match(r'\s*(```|~~~)', line):
            yield from flush()
            fence = not fence
        elif fence or (re.match(r'(    |\t)', line) and not paragraph):
            continue  # A line of a code block.
        elif text.startswith('|'):
            yield from flush()
            if not re.fullmatch(r'[\s|:-]*', line):
                for cell in re.split(r'(?<!\\)\|', text.strip('|')):
                    for sentence in split_sentences(cell):
                        yield Text('sentence', path, number, sentence, '')
        elif (not text or re.match(r'(-{3,}|={3,})$', text) or
              text.startswith(('<!--', '[comment'))):
            yield from flush()
        elif text.startswith('#'):
            yield from flush()
            yield Text('heading', path, number, text.lstrip('# '), '')
        else:
            if re.match(r'([-*+]|\d+[.)])\s', text):
                yield from flush()
                text = re.sub(r'^([-*+]|\d+[.)])\s+(\[.\]\s+)?', '', text)
            if not paragraph:
                start = number
            paragraph.append(re.sub(r'^>\s*', '', text))
    yield from flush()


def html(path, source):
    """Yields the visible text and the descriptive attributes of an HTML page."""
    blank = lambda m: re.sub(r'[^\n]', ' ', m[0])
    visible = re.sub(r'<script\b.*?</script>|<style\b.*?</style>|<!--.*?-->', blank, source,
                     flags=re.S | re.I)
    for m in HTML_TEXT.finditer(visible):
        text = (m[1] or m[2]).strip()
        if text:
            yield Text('ui', path, visible.count('\n', 0, m.start(m.lastindex)) + 1, text, '')


def texts(root, paths=None):
    """Yields every Text of the files `paths` of a checkout. None means all files."""
    for path in files(root) if paths is None else paths:
        source = read(root, path)
        if source is None:
            continue
        extension = os.path.splitext(path)[1]
        if extension in C_LIKE:
            yield from c_like(path, source)
        elif extension == '.md':
            yield from markdown(path, source)
        elif extension in ('.html', '.htm'):
            yield from html(path, source)
        elif (extension in HASH or os.path.basename(path) in HASH_NAMES or
              source.startswith('#!')):
            yield from hash_comments(path, source)
