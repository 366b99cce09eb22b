// Rows by index, into a part of the columns of the result.
//   x [N,C]   index [P] (i32, each in 0..N-1)   out [P,W], of which columns column .. column + C - 1 are written   (f32)
// Work-items (lane, p): the lanes of a row share its channels.
__kernel void gather_rows(__global const float* restrict x, __global const int* restrict index, __global float* restrict out, int P,
                          int C, int W, int column) {
  const int p = get_global_id(1);
  if (p >= P) return;
  __global const float* from = x + (long)index[p] * C;
  __global float* to = out + (long)p * W + column;
  for (int c = get_global_id(0); c < C; c += get_global_size(0)) to[c] = from[c];
}

// Backward: dx [N,C], row index[p] of which is added columns column .. column + C - 1 of dout [P,W]'s row p; other rows stay. No two of
// index are equal, so that no row has two writers; negative ones are passed over.
__kernel void gather_rows_backward(__global const float* restrict dout, __global const int* restrict index, __global float* restrict dx,
                                   int P, int C, int W, int column) {
  const int p = get_global_id(1);
  if (p >= P || index[p] < 0) return;
  __global const float* from = dout + (long)p * W + column;
  __global float* to = dx + (long)index[p] * C;
  for (int c = get_global_id(0); c < C; c += get_global_size(0)) to[c] += from[c];
}
