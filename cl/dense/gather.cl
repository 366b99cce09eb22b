// Copies rows by index into some columns of the result.
// ```
// argument    type  shape  what
// x           f32   [N,C]  rows
// index       i32   [P]    row of x, times `shared`: each in 0 .. N shared - 1
// out         f32   [..,W] rows row0 .. row0 + P - 1, columns column .. column + C - 1 are written: row index[p] /
//                          shared of x; the others stay
// work-items  (lane, p): the lanes of a row share its channels, any number of them
// ```
kernel void gather_forward(global const float* restrict x, global const int* restrict index, global float* restrict out,
                           int P, int C, int W, int column, int shared, int row0) {
  const int p = get_global_id(1);
  if (p >= P) return;
  global const float* from = x + (long)(index[p] / shared) * C;
  global float* to = out + ((long)row0 + p) * W + column;
  for (int c = get_global_id(0); c < C; c += get_local_size(0)) to[c] = from[c];
}

// The same for integers, one a row.
// ```
// argument    type  shape  what
// x           i32   [N]
// index       i32   [P]    each in 0 .. N - 1
// out         i32   [P]    written
// work-items  one per index
// ```
kernel void gather_integers(global const int* restrict x, global const int* restrict index, global int* restrict out,
                            int P) {
  const int p = get_global_id(0);
  if (p < P) out[p] = x[index[p]];
}

// Backward of gather_forward.
// ```
// argument    type  shape  what
// dout        f32   [..,W] gradient of out, of which rows from row0 on, columns column .. column + C - 1 are read
// index       i32   [P]    negative: skipped; no two others are equal, so that no row has two writers. If
//                          `shared` > 1 they ascend: those of a row lie side by side, and the first adds up all
// dx          f32   [N,C]  row index[p] / shared is added to; other rows stay
// work-items  (lane, p): the lanes of a row share its channels, any number of them
// ```
kernel void gather_backward(global const float* restrict dout, global const int* restrict index,
                            global float* restrict dx, int P, int C, int W, int column, int shared, int row0) {
  const int p = get_global_id(1);
  if (p >= P || index[p] < 0) return;
  const int row = index[p] / shared;
  int end = p + 1;
  if (shared > 1) {
    if (p > 0 && index[p - 1] >= 0 && index[p - 1] / shared == row) return;
    while (end < P && index[end] / shared == row) ++end;
  }
  global const float* from = dout + ((long)row0 + p) * W + column;
  global float* to = dx + (long)row * C;
  for (int c = get_global_id(0); c < C; c += get_local_size(0)) {
    float sum = from[c];
    for (int i = 1; i < end - p; ++i) sum += from[(long)i * W + c];
    to[c] += sum;
  }
}
