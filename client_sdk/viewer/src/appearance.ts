// What the scene is drawn as: what somebody chose, or what the machine keeps up with.

import type {Asked} from './url_options.js';
import {Quality} from './quality.js';
import type {FigureStyle, QualityChoice} from './quality.js';
import {basePixelRatio} from './renderer.js';
import type {RendererInfo} from './renderer.js';
import type {ViewOptions} from './scene/world_view.js';

export class Appearance {
  readonly quality: Quality;
  /** The views draw by these. */
  readonly options: ViewOptions;
  /** Canvas pixels a CSS pixel. */
  pixelRatio: number;
  private figures: 'auto' | FigureStyle;
  private shadows: boolean | null = null;
  private level = -1;

  constructor(private readonly info: RendererInfo, asked: Asked, leastFrameMs: number) {
    this.quality = new Quality(info.software, leastFrameMs);
    this.quality.choice = asked.quality;
    this.figures = asked.figures;
    this.pixelRatio = basePixelRatio(info);
    this.options = {
      style: 'bodies', coarse: false, shadows: true, simple: false, prints: true, plants: true,
      plainGround: info.software,
      mostPrints: this.quality.detail.prints,
    };
  }

  chooseFigures(choice: 'auto' | FigureStyle): void {
    this.figures = choice;
    this.level = -1;
  }
  chooseQuality(choice: QualityChoice): void {
    this.quality.choice = choice;
    this.shadows = null;
    this.level = -1;
  }
  toggle(name: 'shadows' | 'prints' | 'plants', on: boolean): void {
    this.options[name] = on;
    if (name === 'shadows') this.shadows = on;
  }

  /** Takes up what the quality has come to; whether that is another. Cheap while it is not. */
  adapt(ms: number, avatars: number): boolean {
    this.quality.frame(ms, avatars);
    const {level, detail} = this.quality;
    if (level === this.level) return false;
    this.level = level;
    const {options} = this;
    options.style = this.figures === 'auto' ? detail.style : this.figures;
    options.coarse = detail.coarse;
    options.simple = detail.simple;
    options.mostPrints = detail.prints;
    options.shadows = this.shadows ?? detail.shadows;
    this.pixelRatio = basePixelRatio(this.info) * detail.scale;
    return true;
  }

  /** "lines at 60 % of the resolution" */
  describe(): string {
    const {options, quality: {detail}} = this;
    return `${options.coarse && options.style === 'bodies' ? 'plain ' : ''}${options.style}` +
      (detail.scale < 1 ? ` at ${(detail.scale * 100).toFixed(0)} % of the resolution` : '');
  }
  /** Why it is not the best there is; empty: it is. */
  whyLowered(): string {
    if (!this.quality.lowered) return '';
    return this.info.software ? 'the processor draws, there is no graphics card' : 'this machine is slower otherwise';
  }
}
