import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {cpSync, mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {test} from 'node:test';
import {root} from './support/environment';

const workspace = `${root}client_sdk`;
const npm = process.env['STRIDEWIRE_NPM'] ?? 'npm';

/** What a user would write: type-checked and run as it stands. */
const program = `
import {Client, PoseFlag, Status, createCrowdPose, createPose} from '@stridewire/client';
import type {AvatarState, Reply, World, WorldEvent} from '@stridewire/client';

class NoSocket {
  binaryType = '';
  readyState = 0;
  bufferedAmount = 0;
  onclose: ((event: {reason: string}) => void) | null = null;
  constructor(readonly url: string) {
    setTimeout(() => this.onclose?.({reason: ''}), 1);
  }
  close(): void {}
  send(): void {}
}

const client = new Client({
  url: 'ws://127.0.0.1:7421/stream', webSocket: NoSocket as unknown as typeof WebSocket});
client.on('error', (code, text) => {
  if (code !== Status.connect_failed) throw new Error(text);
  console.log('told', text);
  client.close();
});
const world: World = client.joinWorld('plaza');
world.on('event', (event: WorldEvent) => console.log(event.type, event.applied.length ?? 0));
const out = createCrowdPose();
const count: number = world.sampleAll(0, out);
const asked: Promise<AvatarState> = world.inspect(1);
asked.catch((error: Error) => console.log('inspect', error.message));
client.connect();
const spawned: Promise<Reply> = world.spawn([{positionM: [0, 0, 0], headingRad: 0}]);
spawned.then((reply) => console.log('spawn', reply.status));
console.log(count, world.sample(1, 0, createPose()), PoseFlag.held, client.state);
// @ts-expect-error: modes are full and quantised
world.observe({mode: 'everything'});
`;

test('the packed package installs into an empty project, type-checks and runs', () => {
  const folder = mkdtempSync(join(tmpdir(), 'stridewire-package-'));
  const run = (command: string, args: string[]): string => execFileSync(
      command, args, {cwd: folder, encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe']});
  try {
    const packed = JSON.parse(execFileSync(
        npm, ['pack', '--json', '--ignore-scripts', '--pack-destination', folder],
        {cwd: `${workspace}/web`, encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore']})) as
        {filename: string, files: {path: string}[]}[];
    const files = packed[0]!.files.map(({path}) => path).sort();
    assert.ok(files.includes('dist/index.js') && files.includes('dist/types/index.d.ts') &&
              files.includes('README.md'), files.join(' '));
    assert.deepEqual(files.filter((path) => /test|node_modules|generated|scripts/.test(path)), []);

    // Its one dependency is there already: nothing is fetched.
    cpSync(`${workspace}/node_modules/flatbuffers`, join(folder, 'node_modules/flatbuffers'),
           {recursive: true});
    writeFileSync(join(folder, 'package.json'), JSON.stringify({
      name: 'empty', private: true, type: 'module', dependencies: {flatbuffers: '25.9.23'},
    }));
    const name = packed[0]!.filename.replace('@', '').replace('/', '-');
    run('tar', ['-xzf', name]);
    cpSync(join(folder, 'package'), join(folder, 'node_modules/@stridewire/client'),
           {recursive: true});
    writeFileSync(join(folder, 'main.ts'), program);
    writeFileSync(join(folder, 'tsconfig.json'), JSON.stringify({
      compilerOptions: {
        strict: true, target: 'es2022', module: 'esnext', moduleResolution: 'bundler',
        lib: ['es2022', 'dom'], types: [], outDir: 'out',
      },
      files: ['main.ts'],
    }));
    const tsc = createRequire(import.meta.url).resolve('typescript/bin/tsc');
    try {
      run(process.execPath, [tsc, '-p', '.']);
    } catch (error) {
      assert.fail(String((error as {stdout: string}).stdout));
    }
    const said = run(process.execPath, ['out/main.js']);
    assert.match(said, /^0 missing 4 connecting$/m);
    assert.match(said, /^inspect This is not known yet|^inspect /m);
    assert.match(said, /^told No connection could be made\.$/m);
    assert.match(said, /^spawn cancelled$/m);
  } finally {
    rmSync(folder, {recursive: true, force: true});
  }
});
