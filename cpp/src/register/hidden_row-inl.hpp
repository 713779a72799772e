// What hides pixels where epipolar lines run nearly along the rows of the reference. Along a row
// the points of one surface lie one behind the other in the source. Something nearer comes back
// over those before it, which are passed by it; in the row where it is, or, as lines are not quite
// along rows, in one of the next. Only such vectors are looked at: those that come back are written
// to a row of cells, those that are passed are compared with it. Included once for each instruction
// set.
#if defined(XCALIB_HIDDEN_ROW_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_HIDDEN_ROW_INL_
#undef XCALIB_HIDDEN_ROW_INL_
#else
#define XCALIB_HIDDEN_ROW_INL_
#endif

#include <algorithm>
#include <cstring>

#include "register/locate-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// Beyond any place along a row. [cells]
constexpr float kNoPlace = 1 << 23;
// Neighbours in a row less than this apart may hide one another; of different rows, which depth
// that slopes shifts against each other, those that overlap by this. [cells]
constexpr float kMinStep = 0.5f, kMinOverlap = 2;
// From the row where something hides to where it does: to so much. [rows]
constexpr double kRowSlack = 0.75;

class HiddenRow {
   public:
    // Nothing may be called where the task has no row of cells. Rows come one after another, up or
    // down as shadows fall; this is the one after `count` others. Points are in `units` of a pixel.
    HWY_INLINE HiddenRow(const RowsTask& task, const Shadows& shadows, int width, int count,
                         double units)
        : grid_(task.row_grid), tolerance_(task.grid), room_(task.hidden), shadows_(&shadows),
          width_(width), vectors_((width + kLanes - 1) / kLanes), count_(count) {
        if (!grid_) return;
        take_slot();
        along_ = of_row(room_->place, 0);
        inverse_z_ = of_row(room_->inverse_z, 0);
        const double per_unit = grid_->per_pixel / units;
        room_->to_cells[slot(0)] = {static_cast<float>(per_unit),
                                    static_cast<float>(grid_->shift - kHalfBack * per_unit)};
        room_->any_written[slot(0)] = false;
    }

    // Where the points of the row are to be put.
    HWY_INLINE RowPoints points() const {
        float* across = room_->across.data();
        if (grid_->along_u) return {along_, across, inverse_z_};
        return {across, along_, inverse_z_};
    }

    // When all of the row have been put, the nearest of which has this 1/z. Is there any that may
    // be hidden?
    HWY_INLINE bool find(float nearest) {
        room_->nearest[turn(0)] = nearest;
        // Behind the last one, a cell ahead, is nothing.
        const int end = vectors_ * kLanes;
        along_[end] = along_[end - 1] + 1 / to_cells(0).per_unit;
        find_bounds();
        any_ = false;
        const int rows = std::min(count_, shadows_->reach);
        for (int back = 0; back <= rows; ++back)
            if (reaches(back, shadows_->longest_of_all)) compare_with(back);
        hiders_ = 0;
        for (int back = 0; back <= rows && any_; ++back)
            if (reaches(back, shadows_->longest_of_all) && room_->any_written[slot(back)])
                hiding_[hiders_++] = back;
        return any_;
    }

    // Of the kVectors vectors from a whole number of them on.
    HWY_INLINE Vectors may_be_hidden(int vector) const {
        return any_ ? room_->passed.data()[vector / kVectors] : 0;
    }

    // Of those that may be: the pixels of the vector that begins at x that something hides.
    HWY_INLINE Mask hidden(int x) const {
        const FloatTag d;
        const Float along = hn::Load(d, along_ + x);
        const Mask is = is_place(along);
        const Float inverse_z = hn::Load(d, inverse_z_ + x);
        const Float bound = hn::MulAdd(inverse_z, set(1.0 + tolerance_->relative_tolerance),
                                       hn::Set(d, tolerance_->absolute_tolerance));
        // A silhouette lies anywhere between the last pixel on it and the first beside it: half a
        // cell to both sides is searched.
        const Int cell = to_cell(hn::Sub(place_of(along, 0), set(0.5)), is);
        HWY_ALIGN std::int32_t at[kLanes];
        hn::Store(cell, IntTag(), at);
        Mask behind = hn::MaskFromVec(hn::Zero(d));
        const int band = x * Shadows::kBands / width_;
        const Float shortest = hn::Set(d, shadows_->shortest[band]);
        const Float longest = hn::Set(d, shadows_->longest[band]);
        for (int i = 0; i < hiders_; ++i) {
            const int back = hiding_[i];
            if (!reaches(back, shadows_->longest[band])) continue;
            const Float nearest = hn::BitCast(d, nearest_at(cells_of_row(back), cell, at));
            const Float nearer = hn::Sub(nearest, inverse_z);
            // A line that something hides at comes from that row.
            const Mask from_there =
                hn::And(hn::Ge(hn::Mul(nearer, longest), set(back - kRowSlack)),
                        hn::Le(hn::Mul(nearer, shortest), set(back + kRowSlack)));
            behind = hn::Or(behind, hn::And(hn::Gt(nearest, bound), from_there));
        }
        return hn::And(behind, is);
    }

   private:
    static HWY_INLINE Mask is_place(Float along) { return hn::Eq(along, along); }  // a number

    HWY_INLINE const HiddenRoom::ToCells& to_cells(int back) const {
        return room_->to_cells[slot(back)];
    }
    HWY_INLINE Float place_of(Float along, int back) const {
        const FloatTag d;
        return hn::MulAdd(along, hn::Set(d, to_cells(back).per_unit),
                          hn::Set(d, to_cells(back).shift));
    }
    HWY_INLINE Int to_cell(Float place, Mask is) const {
        const Float first = set(double{RowGrid::kBefore}), last = set(grid_->count - 1.0);
        // Not negative, so that what is cut off is the fraction.
        return hn::ConvertTo(IntTag(),
                             hn::IfThenElse(is, hn::Min(hn::Max(place, first), last), first));
    }

    // Where what is kept of the row so far back stands. The first place is taken that no longer
    // serves, so that it stays near: usually shadows are far shorter than those looked for.
    HWY_INLINE int turn(int back) const { return (count_ - back) % HiddenRoom::kRows; }
    HWY_INLINE int slot(int back) const { return room_->slots[turn(back)]; }
    HWY_INLINE void take_slot() const {
        std::uint32_t taken = 0;
        for (int back = 1; back <= std::min(count_, shadows_->reach); ++back)
            if (reaches(back, shadows_->longest_of_all)) taken |= 1u << slot(back);
        room_->slots[turn(0)] = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(~taken));
        room_->nearest[turn(0)] = 0;
    }
    template <class T>
    HWY_INLINE T* of_row(AlignedRow<T>& rows, int back) const {
        return rows.data() + static_cast<std::size_t>(slot(back)) * room_->stride;
    }
    HWY_INLINE Nearness* cells_of_row(int back) const {
        return room_->cells.data() + static_cast<std::size_t>(slot(back)) * grid_->room();
    }
    // Does anything in that row hide something in this one?
    HWY_INLINE bool reaches(int back, float longest) const {
        return room_->nearest[turn(back)] * longest + kRowSlack >= back;
    }

    // Of each vector: its lowest and highest place, the highest before and the lowest behind it,
    // and whether in it, or next behind it, a place does not lie ahead of the one before.
    HWY_INLINE void find_bounds() {
        const FloatTag d;
        float *low = of_row(room_->low, 0), *high = of_row(room_->high, 0);
        float *before = of_row(room_->before, 0), *behind = of_row(room_->behind, 0);
        Vectors* breaks = of_row(room_->breaks, 0);
        std::fill_n(of_row(room_->written, 0), stretches(), 0);
        const HiddenRoom::ToCells to = to_cells(0);
        const Float per_unit = hn::Set(d, to.per_unit);
        float highest = -kNoPlace;
        for (int s = 0, i = 0; s < stretches(); ++s) {
            Vectors broken = 0;
            for (int k = 0; k < kVectors && i < vectors_; ++k, ++i) {
                const float* at = along_ + i * kLanes;
                const Float here = hn::Load(d, at);
                const Float steps = hn::Mul(hn::Sub(load(at + 1), here), per_unit);
                float first = at[0] * to.per_unit + to.shift;
                float last = at[kLanes - 1] * to.per_unit + to.shift;
                if (HWY_UNLIKELY(!hn::AllTrue(d, hn::Ge(steps, set(double{kMinStep}))))) {
                    const Mask is = is_place(here);
                    const Float place = place_of(here, 0), none = set(double{kNoPlace});
                    first = hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(is, place, none)));
                    last = hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElse(is, place, hn::Neg(none))));
                    broken |= Vectors{first <= last} << k;
                }
                low[i] = first;
                high[i] = last;
                before[i] = highest;
                highest = std::max(highest, last);
            }
            breaks[s] = broken;
        }
        // Those that round the number up to whole stretches neither hide nor are hidden.
        for (int i = vectors_; i % kVectors != 0; ++i) {
            low[i] = behind[i] = kNoPlace;
            high[i] = before[i] = -kNoPlace;
        }
        float lowest = kNoPlace;
        for (int i = vectors_ - 1; i >= 0; --i) {
            behind[i] = lowest;
            lowest = std::min(lowest, low[i]);
        }
    }
    HWY_INLINE int stretches() const { return (vectors_ + kVectors - 1) / kVectors; }

    // What of the row so far back lies beyond some of this one, against the order of the row. Of
    // two such surfaces the nearer one lies back, or else ahead.
    HWY_INLINE void compare_with(int back) {
        const FloatTag d;
        const float *low = of_row(room_->low, back), *high = of_row(room_->high, 0);
        const float *before = of_row(room_->before, 0), *behind = of_row(room_->behind, back);
        const bool lies_back = grid_->near_lies_back;
        if (!lies_back) {
            low = of_row(room_->low, 0);
            high = of_row(room_->high, back);
            before = of_row(room_->before, back);
            behind = of_row(room_->behind, 0);
        }
        const Vectors* breaks = of_row(room_->breaks, back);
        Vectors *written = of_row(room_->written, back), *passed = room_->passed.data();
        const Float apart = set(back == 0 ? double{kMinStep} : -double{kMinOverlap});
        const auto closer = [&](const float* upper, const float* lower, int first) HWY_ATTR {
            Vectors out = 0;
            for (int k = 0; k < kVectors; k += kLanes) {
                const Float gap =
                    hn::Sub(hn::Load(d, upper + first + k), hn::Load(d, lower + first + k));
                out |= bits(hn::Lt(gap, apart)) << k;
            }
            return out;
        };
        for (int s = 0; s < stretches(); ++s) {
            const int first = s * kVectors;
            const Vectors ahead = closer(behind, high, first), over = closer(low, before, first);
            const Vectors within = back == 0 ? breaks[s] : 0;
            passed[s] = (back == 0 ? 0 : passed[s]) | within | (lies_back ? ahead : over);
            any_ |= passed[s] != 0;
            Vectors come = (within | (lies_back ? over : ahead)) & ~written[s];
            written[s] |= come;
            for (; come; come &= come - 1) {
                const int k = first_of(come);
                write(first + k, back, (breaks[s] >> k) & 1);
            }
        }
    }

    // Raises cells of that row to how near the vector's pixels are.
    HWY_INLINE void write(int vector, int back, bool breaks) const {
        const FloatTag d;
        const IntTag di;
        Nearness* cells = cells_of_row(back);
        if (!room_->any_written[slot(back)])
            std::memset(cells, 0, grid_->room() * sizeof(Nearness));
        room_->any_written[slot(back)] = true;
        const Float along = hn::Load(d, of_row(room_->place, back) + vector * kLanes);
        const Mask is = is_place(along);
        const Float inverse_z =
            hn::IfThenElseZero(is, hn::Load(d, of_row(room_->inverse_z, back) + vector * kLanes));
        const Int cell = to_cell(place_of(along, back), is);
        const auto near = hn::DemoteTo(ShortTag(), hn::ShiftRight<16>(hn::BitCast(di, inverse_z)));
        HWY_ALIGN std::int32_t at[kLanes];
        hn::Store(cell, di, at);
        // Usually from cell to cell: all are written at once if this moves none by more than one,
        // and they all move alike.
        const int first = at[kLanes / 2] - kLanes / 2;
        const Int off = hn::Abs(hn::Sub(hn::Sub(cell, hn::Iota(di, 0)), set(first)));
        if (!breaks && hn::AllTrue(d, hn::And(is, hn::RebindMask(d, hn::Lt(off, set(2)))))) {
            Nearness* to = cells + first;
            return hn::StoreU(hn::Max(hn::LoadU(ShortTag(), to), near), ShortTag(), to);
        }
        HWY_ALIGN Nearness nearness[kLanes];
        hn::Store(near, ShortTag(), nearness);
        for (int i = 0; i < kLanes; ++i) cells[at[i]] = std::max(cells[at[i]], nearness[i]);
    }

    // What is nearest in these cells, which are `at` too, and the ones behind them, as the upper
    // half of a float.
    HWY_INLINE Int nearest_at(const Nearness* cells, [[maybe_unused]] Int cell,
                              const std::int32_t* at) const {
        const IntTag di;
#if HWY_TARGET != HWY_SCALAR
        const int first = at[kLanes / 2] - kLanes;
        const Int index = hn::Sub(cell, set(first));
        if (hn::AllTrue(di, hn::Eq(hn::AndNot(set(2 * kLanes - 1), index), hn::Zero(di))))
            return nearest_in_window(cells + first, 1, index);
#endif
        HWY_ALIGN std::int32_t nearest[kLanes];
        for (int i = 0; i < kLanes; ++i)
            nearest[i] = std::max(cells[at[i]], cells[at[i] + 1]) << 16;
        return hn::Load(di, nearest);
    }

    const RowGrid* grid_;
    const CellGrid* tolerance_;
    HiddenRoom* room_;
    const Shadows* shadows_;
    int width_, vectors_, count_;
    float *along_ = nullptr, *inverse_z_ = nullptr;  // of this row
    bool any_ = false;
    int hiding_[HiddenRoom::kRows], hiders_ = 0;  // rows back of which something was written
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif
