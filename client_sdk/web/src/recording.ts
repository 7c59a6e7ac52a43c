import type {CrowdPose, Recording, WorldEvent} from './types';

/** Estimated memory of an event. */
const eventBytes = 400;

/** The part of a recording that the WebAssembly module keeps: the poses. */
export interface PoseRecording {
  readonly firstTimeS: number;
  readonly lastTimeS: number;
  readonly bytes: number;
  sampleAll(timeS: number, out: CrowdPose): number;
  clear(): void;
}

/** The last seconds of a world, as the client received them. */
export class WorldRecording implements Recording {
  private eventList: WorldEvent[] = [];
  private firstEvent = 0;

  constructor(private readonly poses: PoseRecording, private readonly lengthS: number,
              private readonly maxEvents: number) {}

  get firstTimeS(): number {
    return this.poses.firstTimeS;
  }

  get lastTimeS(): number {
    return this.poses.lastTimeS;
  }

  get bytes(): number {
    return this.poses.bytes + (this.eventList.length - this.firstEvent) * eventBytes;
  }

  clear(): void {
    this.poses.clear();
    this.clearEvents();
  }

  clearEvents(): void {
    this.eventList = [];
    this.firstEvent = 0;
  }

  /** Adds an event. Drops the oldest events if they are too old or too many. */
  addEvent(event: WorldEvent): void {
    if (this.lengthS <= 0) return;
    this.eventList.push(event);
    while (this.eventList.length - this.firstEvent > this.maxEvents ||
           this.eventList[this.firstEvent]!.timeS < event.timeS - this.lengthS) {
      ++this.firstEvent;
    }
    if (2 * this.firstEvent > this.eventList.length) {
      this.eventList = this.eventList.slice(this.firstEvent);
      this.firstEvent = 0;
    }
  }

  events(fromS: number, toS: number): WorldEvent[] {
    return this.eventList.slice(this.firstEvent)
        .filter(({timeS}) => timeS >= fromS && timeS <= toS);
  }

  sampleAll(timeS: number, out: CrowdPose): number {
    return this.poses.sampleAll(timeS, out);
  }
}
