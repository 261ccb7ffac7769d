#pragma once

#include <string>
#include <vector>

#include "tuned_log.hpp"

namespace rhec::sim {

/// Dead reckoning and fixes, as `rhec estimate --dead-reckoning --gps` reads them. Entries are the fixes.
class TunedTables final : public TunedLog {
 public:
  /// `hold_out` names the fixes that judge.
  TunedTables(const Host& host, const LogTables& tables, const Settings& settings, const HoldOut& hold_out);

  const std::vector<TunedEntry>& entries() const override { return entries_; }
  std::string name() const override { return tables_.fixes.name; }
  std::string entry_name(bool is_plural) const override { return is_plural ? "fixes" : "fix"; }
  std::string withheld_unit() const override { return "m"; }
  Robot robot(const Settings& settings) const override;
  std::vector<Tunable> tunables(const Settings& settings, const TuningWishes& wishes) const override;
  std::vector<Innovation> innovations(const Settings& settings, const HoldOut& withheld) const override;
  std::vector<double> predictions(const Settings& settings, const HoldOut& withheld,
                                  bool without_judges) const override;
  std::vector<double> interpolations(const Settings& settings, const HoldOut& withheld) const override;
  std::vector<SensorSummary> sensors(const Settings&, const HoldOut&) const override { return {}; }

 private:
  const Host& host_;
  const LogTables& tables_;
  HoldOut judges_;
  std::vector<TunedEntry> entries_;
};

}  // namespace rhec::sim
