// Rotary position embedding: each pair of channels of a head's query and key is turned by an angle that follows from
// the token's place, in place. Entry j and entry j + D/2 are the two coordinates of one plane.
// ```
// argument    type  shape          what
// qkv         f32   [V,T,3,H,D]    queries, keys and values; of the tokens from P on, q and k are turned. D is even
// turns       f32   [T-P,D/2,2]    cosine and sine of each angle, by token; the same for all views and heads
// P           int                  tokens that come first and are not turned
// work-items  (j of all heads: H D/2, token from P on, view)
// ```
static inline void turn(global float* x, float c, float s, int half_) {
  const float a = x[0], b = x[half_];
  x[0] = a * c - b * s;
  x[half_] = a * s + b * c;
}

// Both q and k, which lie H D apart.
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

// By the turned queries and keys before, by those that were given after: the opposite angle. Arguments as in the
// forward, with the gradient in qkv's place.
kernel void rope_backward(global float* dqkv, global const float* turns, int V, int T, int H, int D, int P) {
  turn_pair(dqkv, turns, V, T, H, D, P, -1.0f);
}
