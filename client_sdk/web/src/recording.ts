import type {CrowdPose, Recording, WorldEvent} from './types';
import type {WorldHandle} from './world';

/** Estimated memory of an event. */
const eventBytes = 400;

/** The last seconds of a world. The WebAssembly module keeps the poses, this class the events. */
export class WorldRecording implements Recording {
  private eventList: WorldEvent[] = [];
  private firstEvent = 0;

  constructor(private readonly world: WorldHandle, private readonly lengthS: number,
              private readonly maxEvents: number) {}

  get firstTimeS(): number {
    return this.world.stateNumbers()?.[3] ?? NaN;
  }

  get lastTimeS(): number {
    return this.world.stateNumbers()?.[4] ?? NaN;
  }

  get bytes(): number {
    const poseBytes = this.world.stateNumbers()?.[2] ?? 0;
    return poseBytes + (this.eventList.length - this.firstEvent) * eventBytes;
  }

  clear(): void {
    this.world.clearPoseRecording();
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
    return this.world.sampleCrowd(timeS, out, true);
  }
}
