// The number formats of matrix products.
#pragma once
#include <array>

namespace vsplat {

// fp32: floats throughout. mixed: the device's matrix units multiply large products with operands rounded to bf16 and
// sums in floats; everything else is as in fp32.
enum class Precision : int { fp32 = 0, mixed = 1 };
const char* name_of(Precision precision);

// What multiplies fragments (cl/dense/matrix.clh): a vendor's units, or the emulation, code that runs on every device
// and defines what the units must compute.
// avx512bf16 and amx, a processor's, multiply pairs of operands in place of fragments (cl/dense/pairs_cpu.clh,
// cl/dense/amx.clh), with the cpu kernels alone; the others, but for the emulation, need the gpu kernels. Where amx is,
// avx512bf16 is, too, and multiplies what is too small or too oddly laid out for it.
enum class MatrixUnit : int { emulated = 0, ptx = 1, dpas = 2, wmma = 3, mfma = 4, avx512bf16 = 5, amx = 6 };
constexpr std::array<MatrixUnit, 7> kMatrixUnits = {MatrixUnit::emulated, MatrixUnit::ptx,  MatrixUnit::dpas,
                                                    MatrixUnit::wmma,     MatrixUnit::mfma, MatrixUnit::avx512bf16,
                                                    MatrixUnit::amx};
constexpr bool is_of_processor(MatrixUnit unit) { return unit == MatrixUnit::avx512bf16 || unit == MatrixUnit::amx; }
const char* name_of(MatrixUnit unit);

}  // namespace vsplat
