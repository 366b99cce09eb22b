// Maps of the input views, 8 numbers a pixel: photograph, drawing, and the drawing's alpha and depth.
#pragma once
#include "runtime/context.h"

namespace vsplat {

inline constexpr long kViewMap = 8;  // photograph 3, colour 3, alpha, depth

// Drawings of n views, as the rasteriser writes them: colours not clamped, depth accumulated.
struct ViewDrawings {
  Tensor colour;  // [n, S, S, 3]
  Tensor alpha;   // [n, S, S]
  Tensor depth;   // [n, S, S]
};

struct ViewMapsForward {
  Tensor images;  // [V, S, S, 3]
  ViewDrawings drawings;
  long first = 0;         // views first .. first + n - 1 are written
  bool by_alpha = false;  // depth is divided by alpha (0 where nothing is drawn)
  Tensor maps;            // [V, S, S, 8]
};
void view_maps_forward(Context& ctx, const ViewMapsForward& a);

struct ViewMapsBackward {
  ViewDrawings drawings;  // as in the forward
  long first = 0;
  bool by_alpha = false;
  Tensor dmaps;            // [V, S, S, 8]: gradient by the forward's maps
  ViewDrawings ddrawings;  // written
};
void view_maps_backward(Context& ctx, const ViewMapsBackward& a);

}  // namespace vsplat
