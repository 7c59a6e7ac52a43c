/**
 * GLSL for grid lines, shared by the flat grid and the terrain mesh. `grid(p, width)` returns the
 * coverage at p, 0 to 1, of lines that are `width` pixels wide and lie at whole coordinates. Lines
 * fade out where they are less than 4 pixels apart, and are invisible where they are less than 1.4
 * pixels apart.
 */
export const gridLines = /* glsl */ `
float grid(vec2 p, float width) {
  vec2 w = fwidth(p);
  vec2 g = abs(fract(p - 0.5) - 0.5) / max(w, vec2(1e-5));
  float l = 1.0 - min(min(g.x, g.y) / width, 1.0);
  return l * (1.0 - smoothstep(0.25, 0.7, max(w.x, w.y)));
}`;
