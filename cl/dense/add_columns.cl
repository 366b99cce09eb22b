// Adds some columns of one tensor to some columns of another, in place. With X = W = C it adds two tensors.
// ```
// argument    type  shape  what
// x           f32   [R,X]  columns from .. from + C - 1 are added
// out         f32   [R,W]  columns column .. column + C - 1 are added to; the others stay
// work-items  (lane, row): the lanes of a row share its channels, any number of them
// ```
kernel void add_columns(global const float* restrict x, global float* restrict out, int R, int C, int X, int from,
                        int W, int column) {
  const int r = get_global_id(1);
  if (r >= R) return;
  global const float* row = x + (long)r * X + from;
  global float* to = out + (long)r * W + column;
  for (int c = get_global_id(0); c < C; c += get_local_size(0)) to[c] += row[c];
}
