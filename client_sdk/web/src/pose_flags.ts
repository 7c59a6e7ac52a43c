import {PoseFlag, type PoseDetail} from './types';
import type {BatchMode} from './wire/messages';

const flagOfDetail = {all: 0, fewer: PoseFlag.fewerJoints, root: PoseFlag.rootOnly};
const detailFlags = flagOfDetail.fewer | flagOfDetail.root;

/** What is true of an avatar until something else is told, unlike a discontinuity. */
export const lastingFlags = PoseFlag.standing | detailFlags;

/** The detail of which a batch's poses are. */
export function detailOf(mode: BatchMode): PoseDetail {
  return mode === 'compactFewer' ? 'fewer' : mode === 'compactRoot' ? 'root' : 'all';
}

/** What a pose's flags say of it: `sent` in a batch of that mode. */
export function flagsOf(sent: number, mode: BatchMode): number {
  return (sent & (PoseFlag.discontinuity | PoseFlag.standing)) | flagOfDetail[detailOf(mode)];
}
