#!/usr/bin/env python3
"""Draws a random sample of the project's prose: a numbered list with files and lines.

Open the file of each entry and mark the entry as clear, awkward (understood at the second reading,
or not what an engineer would write) or obscure. The same seed and checkout give the same list.
"""
import argparse
import os
import random
import re
import subprocess
import sys

import prose_text

EXAMPLES = '''examples:
  prose_sample.py --seed 4711                  100 comments, 60 of public headers, 50 sentences
  prose_sample.py --comments 0 --headers 0 --sentences 0 --messages 40
  prose_sample.py --tests --out sample.md      includes comments of tests
  prose_sample.py --count                      the size of each pool
'''
CODE = ('.h', '.hpp', '.inl', '.c', '.cpp', '.ts', '.mjs', '.fbs')
TITLES = {'comments': 'Comments', 'headers': 'Comments of public headers',
          'sentences': 'Sentences of documents', 'messages': 'Messages, help and UI texts'}


def parse_options():
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('checkout', nargs='?', default='.', help='folder to read (default: .)')
    parser.add_argument('--seed', type=int, help='seed of the draw (default: random)')
    parser.add_argument('--comments', type=int, default=100, metavar='N',
                        help='number of comments outside public headers (default: 100)')
    parser.add_argument('--headers', type=int, default=60, metavar='N',
                        help='number of comments of public C and C++ headers (default: 60)')
    parser.add_argument('--sentences', type=int, default=50, metavar='N',
                        help='number of sentences of documents except measurements (default: 50)')
    parser.add_argument('--messages', type=int, default=0, metavar='N',
                        help='number of error messages, help texts and UI strings (default: 0)')
    parser.add_argument('--tests', action='store_true', help='include comments of tests')
    parser.add_argument('--min-words', type=int, default=4, metavar='N',
                        help='exclude texts with fewer words (default: 4)')
    parser.add_argument('--out', metavar='FILE', help='write the sample to FILE')
    parser.add_argument('--count', action='store_true', help='print only the size of each pool')
    options = parser.parse_args()
    if not os.path.isdir(options.checkout):
        parser.error(f'{options.checkout}: not a folder')
    if options.seed is None:
        options.seed = random.SystemRandom().randrange(10**6)
    return options


def collect(options):
    """Sorts the texts of the checkout into pools."""
    pools = {name: [] for name in TITLES}
    for text in prose_text.texts(options.checkout):
        if len(re.findall(r"[A-Za-z][A-Za-z']+", text.text)) < options.min_words:
            continue
        if prose_text.is_test(text.path) and not options.tests:
            continue
        if text.kind == 'comment' and text.path.endswith(CODE):
            pools['comments'].append(text)
        elif text.kind == 'header':
            pools['headers'].append(text)
        elif text.kind == 'sentence' and 'measurements' not in text.path:
            pools['sentences'].append(text)
        elif text.kind in ('message', 'ui'):
            pools['messages'].append(text)
    return pools


def write_sample(pools, options, out):
    commit = subprocess.run(['git', '-C', options.checkout, 'rev-parse', '--short', 'HEAD'],
                            capture_output=True, text=True).stdout.strip() or 'no commit'
    print(f'# Prose of {commit}, seed {options.seed}', file=out)
    print('\nMark each entry: c clear, a awkward, o obscure.', file=out)
    generator = random.Random(options.seed)
    number = 0
    for name, pool in pools.items():
        size = min(getattr(options, name), len(pool))
        if size == 0:
            continue
        print(f'\n## {TITLES[name]}: {size} of {len(pool)}\n', file=out)
        for text in sorted(generator.sample(pool, size), key=lambda t: (t.path, t.line)):
            number += 1
            print(f'{number}. [ ] {text.path}:{text.line}', file=out)
            for line in text.text.split('\n'):
                print(f'       {line.strip()}', file=out)
            if text.code and name in ('comments', 'headers'):
                print(f'       -> {text.code[:110]}', file=out)
    return number


def main():
    options = parse_options()
    pools = collect(options)
    if options.count:
        for name, pool in pools.items():
            print(f'{len(pool):6} {name}')
    elif options.out:
        with open(options.out, 'w', encoding='utf-8') as out:
            number = write_sample(pools, options, out)
        print(f'Wrote {number} texts (seed {options.seed}) to {options.out}')
    else:
        write_sample(pools, options, sys.stdout)


if __name__ == '__main__':
    try:
        main()
    except BrokenPipeError:
        os._exit(0)
