// Drawing options of the scene. The quality level determines those that the user has not chosen.

import type {UrlOptions} from './url_options.js';
import {Quality} from './quality.js';
import type {FigureStyle, QualityChoice} from './quality.js';
import {fullPixelRatio} from './renderer.js';
import type {RendererInfo} from './renderer.js';
import type {ViewOptions} from './scene/world_view.js';

export class Appearance {
  readonly quality: Quality;
  /** Shared by all views, which read it every frame. */
  readonly options: ViewOptions;
  /** Canvas pixels per CSS pixel. */
  pixelRatio: number;
  private figures: 'auto' | FigureStyle;
  /** The user's choice; null if the quality level decides. */
  private shadows: boolean | null = null;
  private level = -1;

  constructor(private readonly info: RendererInfo, urlOptions: UrlOptions, minFrameMs: number) {
    this.quality = new Quality(info.software, minFrameMs);
    this.quality.choice = urlOptions.quality;
    this.figures = urlOptions.figures;
    this.pixelRatio = fullPixelRatio(info);
    this.options = {
      style: 'bodies', coarse: false, shadows: true, simplified: false, footprints: true,
      plantedFeet: true, software: info.software,
      maxFootprints: this.quality.settings.maxFootprints,
    };
  }

  setFigureStyle(choice: 'auto' | FigureStyle): void {
    this.figures = choice;
    this.level = -1;
  }
  setQuality(choice: QualityChoice): void {
    this.quality.choice = choice;
    this.shadows = null;
    this.level = -1;
  }
  toggle(name: 'shadows' | 'footprints' | 'plantedFeet', on: boolean): void {
    this.options[name] = on;
    if (name === 'shadows') this.shadows = on;
  }

  /** Call once per frame. Applies the quality level and returns whether it has changed. */
  adapt(ms: number, avatars: number): boolean {
    this.quality.onFrame(ms, avatars);
    const {level, settings} = this.quality;
    if (level === this.level) return false;
    this.level = level;
    const {options} = this;
    options.style = this.figures === 'auto' ? settings.style : this.figures;
    options.coarse = settings.coarse;
    options.simplified = settings.simplified;
    options.maxFootprints = settings.maxFootprints;
    options.shadows = this.shadows ?? settings.shadows;
    this.pixelRatio = fullPixelRatio(this.info) * settings.scale;
    return true;
  }

  /** Describes how avatars are drawn, for example "lines at 60 % resolution". */
  describe(): string {
    const {options, quality: {settings}} = this;
    return `${options.coarse && options.style === 'bodies' ? 'simplified ' : ''}${options.style}` +
      (settings.scale < 1 ? ` at ${(settings.scale * 100).toFixed(0)} % resolution` : '');
  }
  /** Returns why the quality was lowered; empty if it was not. */
  loweredReason(): string {
    if (!this.quality.lowered) return '';
    return this.info.software ? 'the browser renders in software' : 'frames took too long';
  }
}
