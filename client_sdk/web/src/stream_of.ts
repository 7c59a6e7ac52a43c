import type {BatchMode, PoseBatch} from './wire/messages';

const streamModes: readonly BatchMode[] = ['full', 'quantised', 'compact', 'compactFewer', 'compactRoot'];

/** A number for a shard's batches of one mode, which are about the same avatars. */
export function streamOf(batch: PoseBatch): number {
  return streamModes.length * batch.shard + streamModes.indexOf(batch.mode);
}
