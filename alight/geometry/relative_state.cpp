#include "alight/geometry/relative_state.h"

namespace alight {

RelativeState boxplus(const RelativeState& x, const Vector9& d) {
  return {x.p_NB + d.head<3>(), x.R_NB * so3_exp(d.segment<3>(3)),
          x.v_NB + d.tail<3>()};
}

Vector9 boxminus(const RelativeState& a, const RelativeState& b) {
  Vector9 d;
  d << a.p_NB - b.p_NB, so3_log(b.R_NB.transpose() * a.R_NB), a.v_NB - b.v_NB;
  return d;
}

}  // namespace alight
