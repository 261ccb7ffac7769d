#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/estimation/rhythm.hpp"

namespace rhec {

/// Brings the stamps of several sources onto one timeline, which no wrong stamp can stop.
///
/// A stamp is used as it is where it continues its source's: late within `behind`, or ahead of all others by no more
/// than a second or ten of the source's usual intervals. Any other is refused until the stamps after it agree with it:
/// the second one confirms a gap (no longer than `longest_gap`), the third one that the source's clock was set. The
/// source's stamps then go on from where they were, and its clock's offset is kept; other sources whose clock was
/// set alike take it over at once. A source whose clock is set back by less than `behind` is recognised by going
/// through times again for which it has delivered already; data that were only held up, or that come in another
/// order, fill a gap that is wider than usual. A step by less than that is recognised where the stamps of a source jump
/// against those of all others, by as much as their own interval is off, and the next two stay there.
///
/// Timeline and stamps in seconds. Allocates in its constructor only.
class RHEC_EXPORT Clocks {
 public:
  struct Setup {
    double usual_interval = 0.2;  ///< of a source, until its own is known [s]
    double behind = 3.0;          ///< how late a measurement can be [s]
    double longest_gap = 60.0;    ///< a longer one is a clock that was set [s]
  };
  Clocks(int sources, const Setup& setup);

  /// The place of a stamp on the timeline; NaN if it is refused.
  double take(int source, double stamp) noexcept;
  /// Another source has delivered with a stamp whose place on the timeline is known.
  void also(int source, double time) noexcept {
    sources_[source].suspects = sources_[source].steps = 0;
    use(sources_[source], time);
  }
  /// The place of a time that somebody asks for, by the clock that fits best; NaN if it is not finite. Nothing changes.
  double place_of(double time) const noexcept { return time - offset_of(time); }
  /// What to subtract from a time that somebody asks for: the offset of the source that brings it closest to now.
  double offset_of(double time) const noexcept;
  /// The newest time on the timeline that a stamp was given; NaN before the first.
  double now() const noexcept { return now_; }
  bool knows_interval(int source) const noexcept { return !std::isnan(sources_[source].rhythm.interval()); }
  /// Usual interval of a source [s]; that of the set-up before its second stamp.
  double usual_interval(int source) const noexcept { return usual_interval(sources_[source]); }
  /// Newest time of a source on the timeline; NaN before its first.
  double newest(int source) const noexcept { return sources_[source].rhythm.last(); }
  /// The first time on the timeline that a stamp of any source was given; NaN before it.
  double first() const noexcept { return first_; }
  /// Whether the source's last stamp was refused, or its clock has just been set.
  bool is_suspected(int source) const noexcept { return sources_[source].suspects > 0 || sources_[source].steps > 0; }
  std::int64_t refused() const noexcept { return refused_; }
  /// How often a clock was set.
  std::int64_t settings() const noexcept { return settings_; }
  void reset() noexcept;

 private:
  static constexpr std::size_t remembered = 128;
  struct Source {
    double offset = 0.0;
    Rhythm rhythm;
    double first_suspect = 0.0, last_suspect = 0.0;  ///< stamps
    double suspect_interval = 0.0;                   ///< the last one
    int suspects = 0;
    // By how much it usually is ahead of all others when it delivers, and how far it is from that [s].
    double usual_lead = 0.0, lead_deviation = 0.0, last_others = 0.0;
    int leads = 0;
    double step = 0.0;                       ///< by which its clock may have been set [s]
    int steps = 0;                           ///< stamps in a row that say so
    std::array<double, remembered> times{};  ///< of its newest stamps, in a ring
    std::size_t count = 0;
  };
  enum class Place { in_order, late, repeated, far_ahead, far_behind };
  Place place(const Source& source, double time) const noexcept;
  /// Whether a time lies between stamps of a source that are no further apart than others.
  static bool is_within(const Source& source, double time) noexcept;
  double usual_interval(const Source& source) const noexcept;
  double room_ahead(const Source& source) const noexcept;
  double use(Source& source, double time) noexcept;
  void suspect(Source& source, double stamp) noexcept;
  double new_offset(const Source& source, double stamp) const noexcept;
  void set_clock(Source& source, double offset) noexcept;
  double newest_of_others(const Source& source) const noexcept;
  bool follows_step(Source& source, double time, double others) noexcept;
  void note_lead(Source& source, double lead) noexcept;
  bool take_over_offset(Source& source, double stamp) noexcept;

  Setup setup_;
  std::vector<Source> sources_;
  double first_, now_;
  std::int64_t refused_ = 0, settings_ = 0;
};

}  // namespace rhec
