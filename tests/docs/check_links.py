#!/usr/bin/env python3
"""check_links.py ROOT: checks the references between documents and files.

- Relative links of Markdown pages lead to existing files, and their anchors to existing headings.
- Backquoted paths and file names exist. A path may omit its first folders: `pose/foot_plant-inl.h`.
  Pages about the past (the changelog, archived measurements, decisions) may name removed files.
- Every page can be reached from README.md by links, and every picture is linked by a page.
"""
import fnmatch
import os
import re
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), '../tools'))
import prose_text

LINK = re.compile(r'\[[^\]]*\]\(<?([^()\s>]+)>?(?:\s+"[^"]*")?\)|^\[[^\]]+\]:\s+(\S+)', re.M)
CODE_BLOCK = re.compile(r'^```.*?^```|^(?: {4}|\t)[^\n]*$', re.S | re.M)
PATH = re.compile(r'(?:[\w.@*-]+/)*[\w.@*-]*')
FILE = re.compile(r'[\w*-][\w.*-]*\.(?:h|hpp|cpp|c|ts|mjs|md|py|sh|fbs|cmake|svg|webp|html)')
PAGE_OF_THE_PAST = re.compile(r'CHANGELOG\.md|docs/measurements_archive\.md|docs/decisions/.*')
PICTURE = re.compile(r'docs/pictures/.*\.(?:svg|webp|png)')


def line_of(source, offset):
    return source.count('\n', 0, offset) + 1


def anchors(source):
    """Returns the anchors that GitHub creates for the headings of a page."""
    titles = re.findall(r'^#+ +(.*)$', re.sub(r'^```.*?^```', '', source, flags=re.S | re.M), re.M)
    return {re.sub(r'[^\w\- ]', '', title.strip().lower()).replace(' ', '-') for title in titles}


def main():
    root = sys.argv[1]
    mistakes = []
    # prose_text.files() leaves out pictures.
    files = set(prose_text.files(root)) | {
        f'docs/pictures/{os.path.relpath(os.path.join(folder, name), root + "/docs/pictures")}'
        for folder, _, names in os.walk(root + '/docs/pictures') for name in names}
    folders = {'/'.join(path.split('/')[:depth])
               for path in files for depth in range(1, path.count('/') + 1)}
    top_folders = {path for path in folders if '/' not in path}
    everything = ['/' + path for path in sorted(files | folders)]
    pages = {path: prose_text.read(root, path) for path in sorted(files) if path.endswith('.md')}

    links = {}  # The targets of each page, from the root.
    for page, source in pages.items():
        prose = CODE_BLOCK.sub(lambda m: re.sub(r'[^\n]', ' ', m[0]), source)
        links[page] = set()
        for m in LINK.finditer(prose):
            target, _, anchor = (m[1] or m[2]).partition('#')
            if re.match(r'\w+:', target):
                continue
            where = f'{page}:{line_of(prose, m.start())}'
            path = os.path.normpath(os.path.join(os.path.dirname(page), target)) if target else page
            links[page].add(path)
            if not os.path.exists(os.path.join(root, path)):
                mistakes.append(f'{where}: {target}: the target of this link does not exist')
            elif anchor and path in pages and anchor not in anchors(pages[path]):
                mistakes.append(f'{where}: #{anchor}: {path} has no such heading')
        if PAGE_OF_THE_PAST.fullmatch(page):
            continue
        for m in re.finditer(r'`([^`\n]+)`', prose):
            token = m[1].rstrip('/').removeprefix('./')
            if re.search(r'(?:^|/)[A-Z]+/', token):
                continue  # A placeholder, such as DIR/index.html.
            is_path = PATH.fullmatch(token) and ('/' in m[1] and token.split('/')[0] in top_folders)
            if not is_path and not (PATH.fullmatch(token) and FILE.fullmatch(token.split('/')[-1])):
                continue
            if not any(fnmatch.fnmatchcase(path, '*/' + token) for path in everything):
                mistakes.append(f'{page}:{line_of(prose, m.start())}: {token}: no such file')

    reached, queue = set(), ['README.md']
    while queue:
        page = queue.pop()
        if page in pages and page not in reached:
            reached.add(page)
            queue += links[page]
    mistakes += [f'{page}:1: no links lead from README.md to this page'
                 for page in pages if page not in reached]
    linked = set().union(*links.values())
    mistakes += [f'{path}: no page links this picture'
                 for path in sorted(files) if PICTURE.fullmatch(path) and path not in linked]
    for mistake in mistakes:
        print(mistake)
    count = sum(len(targets) for targets in links.values())
    print(f'{count} links of {len(pages)} pages, {len(mistakes)} mistakes')
    return 1 if mistakes or count < 100 else 0


if __name__ == '__main__':
    sys.exit(main())
