// Rows taken by index, into some columns of the result.
// ```
// argument    type  shape  what
// x           f32   [N,C]  rows
// index       i32   [P]    which row of x, each in 0 .. N-1
// out         f32   [P,W]  columns column .. column + C - 1 are written: row index[p] of x; the others stay
// work-items  (lane, p): the lanes of a row share its channels, any number of them
// ```
kernel void gather_forward(global const float* restrict x, global const int* restrict index, global float* restrict out,
                           int P, int C, int W, int column) {
  const int p = get_global_id(1);
  if (p >= P) return;
  global const float* from = x + (long)index[p] * C;
  global float* to = out + (long)p * W + column;
  for (int c = get_global_id(0); c < C; c += get_global_size(0)) to[c] = from[c];
}

// Backward of gather_forward.
// ```
// argument    type  shape  what
// dout        f32   [P,W]  gradient of out, of which columns column .. column + C - 1 are read
// index       i32   [P]    negative: passed over; no two others are equal, so that no row has two writers
// dx          f32   [N,C]  row index[p] is added to; other rows stay
// work-items  (lane, p): the lanes of a row share its channels, any number of them
// ```
kernel void gather_backward(global const float* restrict dout, global const int* restrict index,
                            global float* restrict dx, int P, int C, int W, int column) {
  const int p = get_global_id(1);
  if (p >= P || index[p] < 0) return;
  global const float* from = dout + (long)p * W + column;
  global float* to = dx + (long)index[p] * C;
  for (int c = get_global_id(0); c < C; c += get_global_size(0)) to[c] += from[c];
}
