// OpenBLAS and oneDNN at what our kernels do, on the host's memory with as many threads as the device has cores. They
// are linked with a module of their own (references_module.cpp), which is built where they are found and loaded where
// it is asked for, so that nothing else needs them.
//   References::add_product(ctx, prepared, {m, n, k, a, w, bias, residual, activation, want, product});
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "bench/bench.h"
#include "runtime/gemm.h"

namespace vsplat::bench {

// A file beside vsplat-bench in the build folder, for that program and for tests. It need not be there: such files are
// not installed.
std::string beside_bench(const char* file);

class References {
 public:
  // "beside OpenBLAS 0.3.21, oneDNN 2.6.3 with 2 threads", or why they are not there.
  static std::string about(const Context& ctx);

  // What ours has composed on the way (two sources, an affine and SiLU, gathered rows) they get composed: only products
  // are timed. want(i) is element i of out.
  struct Product {
    long m = 0, n = 0, k = 0;
    std::vector<float> a, w, bias, residual;  // [m, k], [n, k], [n], [m, n] or empty
    Activation activation = Activation::none;
    std::function<double(long)> want, product;  // `product`: without bias, activation and residual, as OpenBLAS has it
  };
  struct Convolution {
    long side = 0, cin = 0, cout = 0;
    std::vector<float> x, w, bias, residual;  // [side^3, cin], [cout, cin, 3, 3, 3], [cout], [side^3, cout] or empty
    std::function<double(long)> want;
  };
  struct Attention {
    long v = 0, t = 0, h = 0, d = 0;
    std::vector<float> qkv;  // [v, t, 3, h, d]
    std::function<double(long)> want;
  };
  // make() is called where a library is there, and its numbers stay until the case is done.
  static void add_product(const Context& ctx, Prepared& to, const std::function<Product()>& make);
  static void add_convolution(const Context& ctx, Prepared& to, const std::function<Convolution()>& make);
  static void add_attention(const Context& ctx, Prepared& to, const std::function<Attention()>& make);
};

}  // namespace vsplat::bench
