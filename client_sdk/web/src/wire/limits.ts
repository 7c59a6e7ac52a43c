/** Limits and numbers of protocol/STANDARD.md. */
export const frameHeaderBytes = 16;
export const protocolVersion = 1;

export const featureResume = 1n;
export const featureEventReplay = 2n;
export const featureQuantised = 4n;
export const featureInspect = 16n;
export const featureTerrain = 32n;
export const featureFootprints = 64n;
export const featureWalks = 128n;
export const featureTakeovers = 256n;
export const featureLayers = 512n;
export const featureRefusals = 1024n;
export const featurePlanting = 2048n;

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
export const maxEveryNTicks = 3600;
export const maxBatchParts = 1024;
export const maxReplyMemory = 1024;
export const maxAvatarNumber = 0xffff_ffff;
export const maxDepth = 4;
/** Tables of a payload: of the types capped at 1 MiB or less, and of the others. */
export const maxFewTables = 1024;
export const maxCrowdTables = maxItems + 1024;
