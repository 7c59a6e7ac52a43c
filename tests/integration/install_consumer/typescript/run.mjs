// run.mjs STRIDEWIRED: compiles the first program in the README of the installed package, under two
// module resolutions, and runs both results with this server. Each has to print poses and to end.
import {execFileSync, spawn} from 'node:child_process';
import {once} from 'node:events';
import {mkdirSync, readFileSync, writeFileSync} from 'node:fs';

const stridewired = process.argv[2];
const readmeUrl = 'ws://127.0.0.1:7421/stream';
const minPoses = 3;

function fail(text) {
  console.error(`run.mjs: ${text}`);
  process.exitCode = 1;
}

/** Compiles src/main.ts to out/MODULERESOLUTION/ and returns the path of the program. */
function compile(module, moduleResolution) {
  const project = `tsconfig.${moduleResolution}.json`;
  const outDir = `out/${moduleResolution}`;
  writeFileSync(project, JSON.stringify({
    compilerOptions: {
      strict: true, skipLibCheck: false, target: 'es2022', lib: ['es2022'], types: ['node'], module,
      moduleResolution, outDir,
    },
    files: ['src/main.ts'],
  }));
  execFileSync('node_modules/.bin/tsc', ['-p', project], {stdio: 'inherit'});
  return `${outDir}/main.js`;
}

/** Runs a program for at most a minute and counts the poses that it prints. */
async function walk(program) {
  const child = spawn(process.execPath, [program], {
    stdio: ['ignore', 'pipe', 'inherit'], timeout: 60_000});
  let output = '';
  child.stdout.setEncoding('utf8').on('data', (text) => output += text);
  const [code] = await once(child, 'close');
  const poses = output.match(/root position Float32Array/g)?.length ?? 0;
  console.log(`${program}: exit code ${code}, ${poses} poses`);
  if (code !== 0 || poses < minPoses) {
    fail(`${program}: expected exit code 0 and at least ${minPoses} poses. Output:\n${output}`);
  }
}

const server = spawn(stridewired, ['--listen', '127.0.0.1:0', '--http', '127.0.0.1:0'], {
  stdio: ['ignore', 'pipe', 'inherit']});
try {
  const url = await new Promise((resolve, reject) => {
    let output = '';
    server.stdout.setEncoding('utf8').on('data', (text) => {
      output += text;
      const ready = /ready .*http=(\S+)/.exec(output);
      if (ready) resolve(`ws://${ready[1]}/stream`);
    });
    server.on('error', reject);
    server.on('close', () => reject(new Error(`${stridewired} ended: ${output}`)));
  });
  const readme = readFileSync('node_modules/@stridewire/client/README.md', 'utf8');
  const source = /^```ts\n(.*?)^```$/ms.exec(readme)?.[1] ?? '';
  if (!source.includes(readmeUrl)) throw new Error(`the README has no program with ${readmeUrl}`);
  mkdirSync('src', {recursive: true});
  writeFileSync('src/main.ts', source.replace(readmeUrl, url));
  const programs = [compile('esnext', 'bundler'), compile('nodenext', 'nodenext')];
  await Promise.all(programs.map(walk));
} catch (error) {
  fail(error.message);
} finally {
  server.kill();
}
