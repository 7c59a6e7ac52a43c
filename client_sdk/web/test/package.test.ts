import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {root} from './support/environment';
import {ServerProcess, programs} from './support/server_process';

const workspace = `${root}client_sdk`;
const npm = process.env['STRIDEWIRE_NPM'] ?? 'npm';
const tsc = createRequire(import.meta.url).resolve('typescript/bin/tsc');

/** A user's program with a WebSocket class of its own. */
const program = `
import {Client, PoseFlag, Status, createCrowdPose, createPose} from '@stridewire/client';
import type {AvatarState, Reply, World, WorldEvent} from '@stridewire/client';

class UnreachableSocket {
  binaryType = '';
  readyState = 0;
  bufferedAmount = 0;
  onopen: (() => void) | null = null;
  onmessage: ((event: {data: unknown}) => void) | null = null;
  onclose: ((event: {reason: string}) => void) | null = null;
  onerror: (() => void) | null = null;
  constructor(readonly url: string) {
    setTimeout(() => this.onclose?.({reason: ''}), 1);
  }
  close(): void {}
  send(_data: ArrayBuffer): void {}
}

const client = new Client({url: 'ws://127.0.0.1:7421/stream', webSocket: UnreachableSocket});
client.on('error', (code, text) => {
  if (code !== Status.connect_failed) throw new Error(text);
  console.log('error', text);
  client.close();
});
const world: World = client.joinWorld('plaza');
world.on('event', (event: WorldEvent) => console.log(event.type, event.applied.length ?? 0));
const crowd = createCrowdPose();
const count: number = world.sampleAll(0, crowd);
const inspected: Promise<AvatarState> = world.inspect(1);
inspected.catch((error: Error) => console.log('inspect', error.message));
client.connect();
const spawned: Promise<Reply> = world.spawn([{positionM: [0, 0, 0], headingRad: 0}]);
spawned.then((reply) => console.log('spawn', reply.status));
console.log(count, world.sample(1, 0, createPose()), PoseFlag.held, client.state);
// @ts-expect-error: 'everything' is not a PoseMode.
world.observe({mode: 'everything'});
// @ts-expect-error: Date is not a WebSocket class.
new Client({url: 'ws://127.0.0.1:7421/stream', webSocket: Date});
`;

/** Programs of README.md: for Node.js with `ws`, for browsers, and with a cache of libraries. */
const readme = readFileSync(`${workspace}/web/README.md`, 'utf8');
const readmePrograms = [...readme.matchAll(/^```ts\n(.*?)^```$/gms)].map((match) => match[1]!);

/** A project that has installed the packed package, without access to a registry. */
let project = '';

function run(command: string, args: string[]): string {
  return execFileSync(command, args, {
    cwd: project, encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'], timeout: 120_000});
}

/** Compiles files of the project to out/ and fails with the errors of tsc. */
function compile(files: string[], options: {[name: string]: unknown}): void {
  writeFileSync(join(project, 'tsconfig.json'), JSON.stringify({
    compilerOptions: {
      strict: true, exactOptionalPropertyTypes: true, noUncheckedIndexedAccess: true,
      skipLibCheck: false, target: 'es2022', outDir: 'out', ...options,
    },
    files,
  }));
  try {
    run(process.execPath, [tsc, '-p', '.']);
  } catch (error) {
    assert.fail(String((error as {stdout: string}).stdout));
  }
}

before(() => {
  project = mkdtempSync(join(tmpdir(), 'stridewire-package-'));
  const packed = JSON.parse(execFileSync(
      npm, ['pack', '--json', '--ignore-scripts', '--pack-destination', project],
      {cwd: `${workspace}/web`, encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore']})) as
      {filename: string, files: {path: string}[]}[];
  const files = packed[0]!.files.map(({path}) => path).sort();
  assert.ok(files.includes('dist/index.js') && files.includes('dist/types/src/index.d.ts') &&
            files.includes('README.md'), files.join(' '));
  assert.deepEqual(files.filter((path) => !path.startsWith('dist/')),
                   ['README.md', 'package.json']);

  run('tar', ['-xzf', packed[0]!.filename.replace('@', '').replace('/', '-')]);
  cpSync(join(project, 'package'), join(project, 'node_modules/@stridewire/client'),
         {recursive: true});
  // The other packages come from the workspace, so that nothing is downloaded.
  mkdirSync(join(project, 'node_modules/@types'));
  for (const name of ['flatbuffers', 'ws', '@types/ws', '@types/node', 'undici-types']) {
    cpSync(`${workspace}/node_modules/${name}`, join(project, 'node_modules', name),
           {recursive: true});
  }
  writeFileSync(join(project, 'package.json'),
                JSON.stringify({name: 'user', private: true, type: 'module'}));
  writeFileSync(join(project, 'main.ts'), program);
  assert.equal(readmePrograms.length, 3);
  writeFileSync(join(project, 'readme_node.ts'), readmePrograms[0]!);
  writeFileSync(join(project, 'readme_browser.ts'), readmePrograms[1]!);
  writeFileSync(join(project, 'readme_cache.ts'), readmePrograms[2]!);
});

after(() => rmSync(project, {recursive: true, force: true}));

for (const [module, moduleResolution] of [['esnext', 'bundler'], ['nodenext', 'nodenext']]) {
  const resolution = {module, moduleResolution};

  test(`type-checks with ws in Node.js, module resolution ${moduleResolution}`, () => {
    compile(['main.ts', 'readme_node.ts', 'readme_cache.ts'],
            {...resolution, lib: ['es2022'], types: ['node']});
  });

  test(`type-checks with browser types, module resolution ${moduleResolution}`, () => {
    compile(['main.ts', 'readme_browser.ts'],
            {...resolution, lib: ['es2022', 'dom'], types: []});
  });
}

test('the installed package runs', () => {
  compile(['main.ts'], {module: 'nodenext', lib: ['es2022'], types: ['node']});
  const output = run(process.execPath, ['out/main.js']);
  assert.match(output, /^0 missing 4 connecting$/m);
  assert.match(output, /^inspect the world is not joined$/m);
  assert.match(output, /^error The connection failed\.$/m);
  assert.match(output, /^spawn cancelled$/m);
});

test('the installed package runs in a worker', () => {
  writeFileSync(join(project, 'worker.mjs'), `
      import {Worker, isMainThread} from 'node:worker_threads';
      if (isMainThread) new Worker(new URL(import.meta.url));
      else await import('./out/main.js');`);
  compile(['main.ts'], {module: 'nodenext', lib: ['es2022'], types: ['node']});
  assert.match(run(process.execPath, ['worker.mjs']), /^error The connection failed\.$/m);
});

test('creating a client fails with a reason where WebAssembly or SIMD is missing', () => {
  for (const [missing, reason] of [
    ['globalThis.WebAssembly = undefined', 'no WebAssembly, which'],
    ['WebAssembly.validate = () => false', 'no WebAssembly SIMD, which .* Node.js 18 or newer'],
  ]) {
    writeFileSync(join(project, 'missing.mjs'), `
        ${missing};
        const {Client} = await import('@stridewire/client');
        try {
          new Client({url: 'ws://127.0.0.1:7421/stream', webSocket: class {}});
        } catch (error) {
          console.log(error.message);
        }`);
    assert.match(run(process.execPath, ['missing.mjs']), new RegExp(reason!));
  }
});

const skip = programs === undefined && 'set STRIDEWIRE_BIN to a folder of built programs';

test('the quick start of README.md walks and prints poses', {skip}, async () => {
  const server = await ServerProcess.start();
  try {
    const url = 'ws://127.0.0.1:7421/stream';
    assert.ok(readmePrograms[0]!.includes(url));
    writeFileSync(join(project, 'quick_start.ts'), readmePrograms[0]!.replace(url, server.url));
    compile(['quick_start.ts'], {module: 'nodenext', lib: ['es2022'], types: ['node']});
    const output = run(process.execPath, ['out/quick_start.js']);
    const positions = output.matchAll(/root position Float32Array\(3\) \[\s*\S+,\s+(\S+),/g);
    const heightsM = [...positions].map((match) => Number(match[1]));
    assert.ok(heightsM.length >= 3, output.slice(0, 1000));
    for (const heightM of heightsM) assert.ok(heightM > 0.5 && heightM < 1.5, `${heightM} m`);
  } finally {
    await server.kill();
  }
});
