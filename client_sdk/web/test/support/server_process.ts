import {spawn, type ChildProcess} from 'node:child_process';
import {once} from 'node:events';

/** Folder of the built programs; undefined: tests with them are skipped. */
export const programs = process.env['STRIDEWIRE_BIN'];

/** A stridewired of our own, on ports that are free. */
export class ServerProcess {
  private constructor(private readonly child: ChildProcess, readonly port: number,
                      readonly httpPort: number) {}

  /** On free ports, or where another one was before: that a port is taken meanwhile passes. */
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

  private static async launch(port: number, httpPort: number, more: string[]): Promise<ServerProcess> {
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
      child.on('close', () => reject(new Error(`stridewired ended: ${out}`)));
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

/** What a program of ours says. */
export async function run(program: string, args: string[]): Promise<string> {
  const child = spawn(`${programs}/${program}`, args, {stdio: ['ignore', 'pipe', 'inherit']});
  let out = '';
  child.stdout!.setEncoding('utf8');
  child.stdout!.on('data', (text: string) => out += text);
  const [code] = await once(child, 'close');
  if (code !== 0) throw new Error(`${program} ended with ${code}`);
  return out;
}

/** Waits for what must come, however slow the machine is. */
export async function until(what: string, holds: () => boolean, seconds = 120): Promise<void> {
  const endMs = performance.now() + 1000 * seconds;
  while (!holds()) {
    if (performance.now() > endMs) throw new Error(`waited ${seconds} s until ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 10));
  }
}
