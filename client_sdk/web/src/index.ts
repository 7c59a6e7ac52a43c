/** Client for Stridewire servers: spawns avatars, requests movements and samples received poses. */
export * from './client_types';
export * from './types';
export {Client} from './client';
export {StridewireError} from './error';
export {Status, statusName, statusText} from './status';
export {createCrowdPose, createPose} from './pose_buffers';
/** Contents of `@stridewire/client/testing`, which shares the WebAssembly module. @internal */
export * as testing from './testing';
