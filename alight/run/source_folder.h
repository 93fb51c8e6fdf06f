#pragma once
#include <string>

#include "alight/base/result.h"

namespace alight {

/// Makes the folder of a SOURCE, or takes out of it what an earlier one of Alight's
/// wrote there: the list of its pictures first, then these and what was known of them.
/// A recording that breaks off does not pass for the earlier one, nor for a mixture of
/// both.
///
/// Touches no files but those that `alight render` and `alight land --frames` write,
/// and pictures only beside a `rig_true.yaml`: others have no truth.
/// @returns io, when the folder cannot be made or its files not be removed
Result<void> begin_source(const std::string& folder);

}  // namespace alight
