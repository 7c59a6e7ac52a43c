import type {
  ClientMessage, FetchLibrary, Goodbye, Hello, InspectAvatar, Ping, PoseBatch, PoseMode
} from '../../generated/messages';
import type {CompactCodec} from './compact_codec';

/** Messages as plain objects, as decodeFrame returns them and Encoder takes them. */
export type * from '../../generated/messages';

/** Messages that the server answers with a Reply. */
export type CommandMessage =
    Exclude<ClientMessage, Hello | Ping | InspectAvatar | FetchLibrary | Goodbye>;

/** Encoding of a batch. Servers send compact batches to clients that requested `quantised`, if they
 * can. */
export type BatchMode = Exclude<PoseMode, 'movement'>;

/** A batch with the decoder for compact poses of its world. `poses` is not validated yet;
 * PoseReader does that. */
export interface DecodableBatch extends PoseBatch {
  mode: BatchMode;
  codec: CompactCodec | null;
}
