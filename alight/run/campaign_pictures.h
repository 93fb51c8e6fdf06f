#pragma once
#include <string>
#include <vector>

#include "alight/run/campaign.h"

namespace alight {

/// Pictures of a campaign, in a folder that is made: `touchdown.png`, how error, speed
/// and tilt at touch-down and the tracking error spread, a line a scenario; of a grid
/// of faults `faults.png`, a dot a fault and instant, instead. @returns their names.
Result<std::vector<std::string>> save_campaign_pictures(const std::string& folder,
                                                        const CampaignOptions& options,
                                                        const CampaignResult& result);

}  // namespace alight
