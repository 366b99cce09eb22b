// In what numbers products of matrices are made.
#pragma once
#include <array>

namespace vsplat {

// fp32: floats throughout. mixed: the operands of large products are rounded to bf16, and their products summed in
// floats, by a device's matrix units; everything else is as in fp32.
enum class Precision : int { fp32 = 0, mixed = 1 };
const char* name_of(Precision precision);

// Who multiplies fragments (cl/dense/matrix.clh): a vendor's units, or code that every device runs, which says what they are
// to compute.
enum class MatrixUnit : int { emulated = 0, ptx = 1, dpas = 2, wmma = 3, mfma = 4 };
constexpr std::array<MatrixUnit, 5> kMatrixUnits = {MatrixUnit::emulated, MatrixUnit::ptx, MatrixUnit::dpas,
                                                    MatrixUnit::wmma, MatrixUnit::mfma};
const char* name_of(MatrixUnit unit);

}  // namespace vsplat
