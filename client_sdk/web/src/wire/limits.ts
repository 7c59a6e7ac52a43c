/** Constants of protocol/STANDARD.md. */
export const frameHeaderBytes = 16;
export const protocolVersion = 1;

export const maxHelloBytes = 16 << 10;
export const maxControlBytes = 1 << 20;
export const maxBulkBytes = 16 << 20;
export const maxItems = 65_536;
export const maxNameBytes = 64;
export const maxTextBytes = 1024;
export const maxReasonBytes = 256;
export const maxAuthTokenBytes = 4096;
export const minResumeTokenBytes = 16;
export const maxResumeTokenBytes = 64;
export const maxJoints = 256;
export const maxEndSites = 256;
export const maxRateRings = 4;
export const maxParameters = 7;
export const maxKeytimes = 9;
export const maxWeights = 4096;
export const maxInspectedRequests = 16;
export const maxLandings = 2;
export const maxPlayingLayers = 4;
export const maxTerrainColumns = 1024;
export const maxTerrainBoxes = 65_536;
export const maxWaypoints = 64;
export const maxLayerNames = 64;
export const maxRecordBytes = 64 << 10;
export const maxPieceBytes = 1 << 20;
export const maxLibraryBytes = 2 ** 30;
export const maxEveryNTicks = 3600;
export const maxBatchParts = 1024;
export const maxReplyMemory = 1024;
export const maxAvatarNumber = 0xffff_ffff;
export const maxDepth = 4;
/** Limits of FlatBuffers tables per payload: for message types of at most 1 MiB, and for others. */
export const maxFewTables = 1024;
export const maxCrowdTables = maxItems + 1024;
