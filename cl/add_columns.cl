// Sums in place: out [R, W], to columns column .. column + C - 1 of which x [R, C] is added; the others stay. W = C adds two
// tensors. Work-items (lane, row): the lanes of a row share its channels.
kernel void add_columns(global const float* restrict x, global float* restrict out, int R, int C, int W, int column) {
  const int r = get_global_id(1);
  if (r >= R) return;
  global const float* from = x + (long)r * C;
  global float* to = out + (long)r * W + column;
  for (int c = get_global_id(0); c < C; c += get_global_size(0)) to[c] += from[c];
}
