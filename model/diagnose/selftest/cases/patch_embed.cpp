#include "model/diagnose/selftest/reference/patch_embed.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/patch_embed.h"
#include "runtime/gemm.h"

namespace vsplat::selftest {
namespace {

void patch_embed_all(Checks& c) {
  struct Try {
    ref::PatchSizes z;
    long channels;
  };
  for (const Try& t : c.some({Try{{1, 1, 1, 1}, 1},
                              {{2, 6, 6, 3}, 7},
                              {{3, 21, 21, 7}, 12},
                              {{1, 48, 48, 16}, 33},
                              {{4, 36, 36, 3}, 65},
                              {{2, 6, 10, 2, 5, false}, 7},
                              {{1, 3, 6, 3, 0}, 6}},
                             {{{2, 34, 34, 17}, 5}, {{1, 10, 4, 2, 3}, 5}})) {
    const auto& z = t.z;
    const long k = static_cast<long>(3 * z.p * z.p), v = static_cast<long>(z.v), p = static_cast<long>(z.p),
               tokens = static_cast<long>(z.tokens()), rows = static_cast<long>(z.rows());
    const auto images = random_floats(z.v * z.height * z.width * 3, 1, 0, 1),
               weight = random_floats(size_of(t.channels, k), 2), bias = random_floats(size_of(t.channels), 3),
               position = random_floats(size_of(rows, t.channels), 4, -5, 5),
               dtokens = random_floats(size_of(v * tokens, t.channels), 5);
    const PackedMatrix packed = pack_matrix(c.ctx, weight.data(), k, t.channels, 1, k, "weight");
    const PatchEmbedForward f{c.up({v, static_cast<long>(z.height), static_cast<long>(z.width), 3}, images),
                              static_cast<int>(z.p),
                              &packed,
                              c.up({t.channels}, bias),
                              c.up({rows, t.channels}, position),
                              c.gap({v, tokens, t.channels})};
    patch_embed_forward(c.ctx, f);
    c.close(
        "forward", f.out, [&] { return ref::patch_embed(images, z, weight, bias, position); }, 1e-5);
    const auto dweight = random_floats(weight.size(), 6), dbias = random_floats(bias.size(), 7);
    const PatchEmbedBackward b{f.images,
                               static_cast<int>(z.p),
                               c.up({v, tokens, t.channels}, dtokens),
                               c.up({t.channels, 3, p, p}, dweight),
                               c.up({t.channels}, dbias),
                               c.gap({rows, t.channels})};
    patch_embed_backward(c.ctx, b);
    const auto want = ref::patch_embed_backward(images, z, size_of(t.channels), as_doubles(dtokens));
    c.close("backward, dweight", b.dweight, plus(want.weight, dweight), 1e-5);
    c.close("backward, dbias", b.dbias, plus(want.bias, dbias), 1e-5);
    if (rows > 0) c.close("backward, dposition", b.dposition, want.position, c.within(1e-5, 1e-6));
  }
}

}  // namespace

VSPLAT_CASES(patch_embed, {"patch_embed", patch_embed_all})

}  // namespace vsplat::selftest
