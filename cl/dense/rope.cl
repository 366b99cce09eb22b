// Rotary position embedding: rotates each pair of channels of a head's query and key in place, by an angle that depends
// on the token's position. Entries j and j + D/2 are the two coordinates of one plane.
// ```
// argument    type  shape          what
// qkv         f32   [V,T,3,H,D]    queries, keys and values; q and k of the tokens from P on are rotated. D is even
// turns       f32   [T-P,D/2,2]    cosine and sine of each angle, by token; shared by all views and heads
// P           int                  first tokens, which are not rotated
// work-items  (j of all heads: H D/2, token from P on, view)
// ```
static inline void turn(global float* x, float c, float s, int half_) {
  const float a = x[0], b = x[half_];
  x[0] = a * c - b * s;
  x[half_] = a * s + b * c;
}

// Rotates both q and k, which lie H D apart.
static inline void turn_pair(global float* qkv, global const float* turns, int V, int T, int H, int D, int P,
                             float sign) {
  const int i = get_global_id(0), token = get_global_id(1), v = get_global_id(2), half_ = D / 2;
  if (i >= H * half_ || token >= T - P || v >= V) return;
  const int h = i / half_, j = i % half_;
  const float2 by = vload2(token * half_ + j, turns);
  global float* q = qkv + (((size_t)v * T + P + token) * 3 * H + h) * D + j;
  turn(q, by.x, sign * by.y, half_);
  turn(q + (size_t)H * D, by.x, sign * by.y, half_);
}

kernel void rope_forward(global float* qkv, global const float* turns, int V, int T, int H, int D, int P) {
  turn_pair(qkv, turns, V, T, H, D, P, 1.0f);
}

// Backward: rotates the gradient by the opposite angle. Arguments as in the forward, with the gradient in qkv's place.
kernel void rope_backward(global float* dqkv, global const float* turns, int V, int T, int H, int D, int P) {
  turn_pair(dqkv, turns, V, T, H, D, P, -1.0f);
}
