// Rows by index, into a part of the columns of the result.
//   x [N,C]   index [P] (i32, each in 0..N-1)   out [P,W], of which columns column .. column + C - 1 are written   (f32)
// Work-items (lane, p): the lanes of a row share its channels.
kernel void gather_forward(global const float* restrict x, global const int* restrict index, global float* restrict out,
                           int P, int C, int W, int column) {
  const int p = get_global_id(1);
  if (p >= P) return;
  global const float* from = x + (long)index[p] * C;
  global float* to = out + (long)p * W + column;
  for (int c = get_global_id(0); c < C; c += get_global_size(0)) to[c] = from[c];
}

// Backward: dx [N,C], row index[p] of which is added columns column .. column + C - 1 of dout [P,W]'s row p; other rows stay. No two of
// index are equal, so that no row has two writers; negative ones are passed over.
kernel void gather_backward(global const float* restrict dout, global const int* restrict index,
                            global float* restrict dx, int P, int C, int W, int column) {
  const int p = get_global_id(1);
  if (p >= P || index[p] < 0) return;
  global const float* from = dout + (long)p * W + column;
  global float* to = dx + (long)index[p] * C;
  for (int c = get_global_id(0); c < C; c += get_global_size(0)) to[c] += from[c];
}
