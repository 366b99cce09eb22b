/* What bench/references.cpp asks of the module that is linked with OpenBLAS and oneDNN. Plain C, as modules are found
   by name. Matrices are row-major and channels last; what may be NULL says so. */
#pragma once

struct VsplatProduct { /* out = act(a w^T + bias) + residual */
  long m, n, k;
  const float *a, *w;           /* [m, k], [n, k] */
  const float *bias, *residual; /* [n], [m, n], or NULL; not looked at by OpenBLAS, which only multiplies */
  int activation;               /* 0 none, 1 GELU, 2 SiLU; likewise */
  float* out;                   /* [m, n] */
};

struct VsplatConvolution { /* 3x3x3, zero padding 1 */
  long side, cin, cout;
  const float* x;               /* [side^3, cin] */
  const float* w;               /* [cout, cin, 3, 3, 3] */
  const float *bias, *residual; /* [cout], [side^3, cout] or NULL */
  float* out;                   /* [side^3, cout] */
};

struct VsplatAttention { /* softmax(q k^T / sqrt(d)) v of each head */
  long v, t, h, d;
  const float* qkv; /* [v, t, 3, h, d] */
  float* out;       /* [v, t, h d] */
};

#ifdef __cplusplus
extern "C" {
#endif
/* "OpenBLAS 0.3.21, oneDNN 2.6.3", of what it was built with. */
const char* vsplat_references_about(void);
void vsplat_references_threads(int count);
/* Each makes a task ready: NULL where the library is not there, or refuses, and what it said. What the tasks point to
   has to stay. */
void* vsplat_openblas_product(const struct VsplatProduct* task);
void* vsplat_onednn_product(const struct VsplatProduct* task);
void* vsplat_onednn_convolution(const struct VsplatConvolution* task);
void* vsplat_onednn_attention(const struct VsplatAttention* task);
const char* vsplat_reference_trouble(void);
void vsplat_reference_run(void* task);
/* Brings the result to `out`, from the layout that the library chose. */
void vsplat_reference_read(void* task);
void vsplat_reference_end(void* task);
#ifdef __cplusplus
}
#endif
