import {PoseFlag, type PoseDetail} from './types';
import type {BatchMode} from './wire/messages';

const flagOfDetail = {all: 0, reduced: PoseFlag.reducedJoints, root: PoseFlag.rootOnly};
const detailFlags = flagOfDetail.reduced | flagOfDetail.root;

/** Flags that stay true between two received poses, unlike `discontinuity`. */
export const lastingFlags = PoseFlag.standing | detailFlags;

/** Returns the detail of poses that arrive in batches of this mode. */
export function detailOf(mode: BatchMode): PoseDetail {
  return mode === 'compactFewer' ? 'reduced' : mode === 'compactRoot' ? 'root' : 'all';
}

/** Converts the flags of a pose in a batch of this mode to `PoseFlag` bits. */
export function flagsOf(sent: number, mode: BatchMode): number {
  return (sent & (PoseFlag.discontinuity | PoseFlag.standing)) | flagOfDetail[detailOf(mode)];
}
