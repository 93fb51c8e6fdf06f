#pragma once
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace alight {

/// What a caller may branch on; anything else goes in `detail`.
enum class Fault {
  invalid_config,  ///< A setting out of range, of the wrong kind or unknown.
  invalid_input,   ///< Data that cannot be what it says: NaN, wrong size, back in time.
  too_few_points,  ///< Fewer LEDs in view than the problem needs.
  degenerate,      ///< The geometry does not decide the answer.
  no_convergence,  ///< An iteration ran out before its tolerance.
  ambiguous,       ///< Two answers fit about equally well.
  infeasible,      ///< No trajectory satisfies the constraints.
  io               ///< A file, folder or device that cannot be read or written.
};

/// An expected failure.
struct Error {
  Fault fault;
  std::string detail;  ///< For people: what, where, what to do. Empty in the control
                       ///< loop: no allocation.
};

/// A value, or an expected failure. Bugs are asserted, never returned.
template <class T>
class [[nodiscard]] Result : public tl::expected<T, Error> {
  using tl::expected<T, Error>::expected;
};

/// Propagate with `if (!found) return fail(found.error());`.
inline auto fail(Error error) { return tl::unexpected<Error>(std::move(error)); }
inline auto fail(Fault fault, std::string detail = {}) {
  return tl::unexpected<Error>(Error{fault, std::move(detail)});
}

}  // namespace alight
