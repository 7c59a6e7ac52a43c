import {spawn, type ChildProcess} from 'node:child_process';
import {once} from 'node:events';

/** Folder of the built programs. If undefined, tests that need them are skipped. */
export const programs = process.env['STRIDEWIRE_BIN'];

/** A stridewired process that belongs to a test. */
export class ServerProcess {
  private constructor(private readonly child: ChildProcess, readonly port: number,
                      readonly httpPort: number) {}

  /** Starts a server on free ports (0) or on the given ports. A port of an earlier server may still
   * be in use, so this retries for up to 10 s. */
  static async start(port = 0, httpPort = 0, more: string[] = []): Promise<ServerProcess> {
    for (let attempt = 1; ; ++attempt) {
      try {
        return await ServerProcess.launch(port, httpPort, more);
      } catch (error) {
        if (port === 0 || attempt === 20) throw error;
        await new Promise((resolve) => setTimeout(resolve, 500));
      }
    }
  }

  private static async launch(port: number, httpPort: number,
                              more: string[]): Promise<ServerProcess> {
    const child = spawn(`${programs}/stridewired`, [
      '--listen', `127.0.0.1:${port}`, '--http', `127.0.0.1:${httpPort}`, '--log-level', 'warning',
      ...more
    ], {stdio: ['ignore', 'pipe', 'inherit']});
    let out = '';
    child.stdout!.setEncoding('utf8');
    const ready = await new Promise<RegExpExecArray>((resolve, reject) => {
      child.on('error', reject);
      child.stdout!.on('data', (text: string) => {
        out += text;
        const found = /ready listen=\S+:(\d+) http=\S+:(\d+)/.exec(out);
        if (found !== null) resolve(found);
      });
      child.on('close', () => reject(new Error(`stridewired exited: ${out}`)));
    });
    return new ServerProcess(child, Number(ready[1]), Number(ready[2]));
  }

  get url(): string {
    return `ws://127.0.0.1:${this.httpPort}/stream`;
  }

  async kill(signal: NodeJS.Signals = 'SIGKILL'): Promise<void> {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    const ended = once(this.child, 'exit');
    this.child.kill(signal);
    await ended;
  }
}

/** Runs one of the built programs and returns its output. */
export async function run(program: string, args: string[]): Promise<string> {
  const child = spawn(`${programs}/${program}`, args, {stdio: ['ignore', 'pipe', 'inherit']});
  let out = '';
  child.stdout!.setEncoding('utf8');
  child.stdout!.on('data', (text: string) => out += text);
  const [code] = await once(child, 'close');
  if (code !== 0) throw new Error(`${program} exited with code ${code}`);
  return out;
}

/** Polls until `holds` returns true. The long default timeout is for slow machines. */
export async function until(what: string, holds: () => boolean, seconds = 120): Promise<void> {
  const endMs = performance.now() + 1000 * seconds;
  while (!holds()) {
    if (performance.now() > endMs) {
      throw new Error(`timed out after ${seconds} s, waiting until ${what}`);
    }
    await new Promise((resolve) => setTimeout(resolve, 10));
  }
}
