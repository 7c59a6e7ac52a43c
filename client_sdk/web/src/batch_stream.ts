import type {BatchMode, DecodableBatch as PoseBatch} from './wire/messages';

const batchModes: readonly BatchMode[] =
    ['full', 'quantised', 'compact', 'compactFewer', 'compactRoot'];

/**
 * Returns the number of the stream that a batch belongs to, unique within a world. The stream of a
 * shard and a mode contains the same avatars in every tick, unless avatars come or go.
 */
export function streamOf(batch: PoseBatch): number {
  return batchModes.length * batch.shard + batchModes.indexOf(batch.mode);
}
