// GLSL that both grounds share, the endless plane and the uneven one.

/** `grid(p, width)`: how much of a line lies at p, lines at whole numbers, `width` pixels wide; nothing where they
 * would lie closer than the pixels. */
export const gridLines = /* glsl */ `
float grid(vec2 p, float width) {
  vec2 w = fwidth(p);
  vec2 g = abs(fract(p - 0.5) - 0.5) / max(w, vec2(1e-5));
  float l = 1.0 - min(min(g.x, g.y) / width, 1.0);
  return l * (1.0 - smoothstep(0.25, 0.7, max(w.x, w.y)));
}`;
