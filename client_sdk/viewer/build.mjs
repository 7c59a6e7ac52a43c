// Bundles the viewer. Usage: node build.mjs --out DIR
// Writes index.html, library.html and assets/NAME-HASH.{js,css,svg} to DIR.

import {createHash} from 'node:crypto';
import {mkdir, readFile, readdir, rm, writeFile} from 'node:fs/promises';
import {dirname, join, resolve} from 'node:path';
import {fileURLToPath} from 'node:url';

import * as esbuild from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const outAt = process.argv.indexOf('--out');
const out = resolve(outAt > 0 ? process.argv[outAt + 1] : join(here, 'dist'));
const assets = join(out, 'assets');

const result = await esbuild.build({
  entryPoints: {viewer: join(here, 'src/main.ts'), library: join(here, 'src/library/main.ts')},
  bundle: true,
  format: 'esm',
  target: ['es2022'],
  minify: true,
  legalComments: 'eof',
  write: false,
  outdir: assets,
  logLevel: 'warning',
});
const bundle = (name) =>
  result.outputFiles.find(({path}) => path === join(assets, `${name}.js`)).contents;
const style = await esbuild.transform(
  await readFile(join(here, 'src/style.css'), 'utf8'), {loader: 'css', minify: true});

const files = {
  SCRIPT: ['viewer', 'js', bundle('viewer')],
  LIBRARY: ['library', 'js', bundle('library')],
  STYLE: ['viewer', 'css', Buffer.from(style.code)],
  ICON: ['icon', 'svg', await readFile(join(here, 'src/icon.svg'))],
};
await mkdir(assets, {recursive: true});
const names = ['index.html', 'library.html'];
const pages = await Promise.all(names.map((name) => readFile(join(here, name), 'utf8')));
const written = new Set();
for (const [placeholder, [name, extension, contents]] of Object.entries(files)) {
  const hash = createHash('sha256').update(contents).digest('hex').slice(0, 12);
  const file = `${name}-${hash}.${extension}`;
  await writeFile(join(assets, file), contents);
  written.add(file);
  // The path is relative, so that the pages also work below a path prefix.
  pages.forEach((page, i) => (pages[i] = page.replaceAll(`%${placeholder}%`, `assets/${file}`)));
}
for (const file of await readdir(assets)) {
  if (!written.has(file)) await rm(join(assets, file));  // Removes files of an earlier build.
}
await Promise.all(names.map((name, i) => writeFile(join(out, name), pages[i])));
