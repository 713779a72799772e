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

// Places along a row are in cells. Beyond all of them, and further still from pixel to pixel, are
// those of pixels that have none.
constexpr double kFarthestPlace = 2097152, kNoPlace = 2 * kFarthestPlace;  // 2^21
constexpr float kFirstNoPlace = static_cast<float>(kNoPlace);
// Neighbours in a row less than this apart may hide one another; of different rows, which depth
// that slopes shifts against each other, those that overlap by this. [cells]
constexpr float kMinStep = 0.5f, kMinOverlap = 2;
// From the row where something hides to where it does: to so much. [rows]
constexpr double kRowSlack = 0.75;

class HiddenRow {
   public:
    // Nothing may be called but may_be_hidden where the task has no row of cells. Rows come one
    // after another, up or down as shadows fall; this is the one after `count` others.
    HWY_INLINE HiddenRow(const RowsTask& task, const Shadows& shadows, int width, int count)
        : grid_(task.row_grid), tolerance_(task.grid), room_(task.hidden), shadows_(&shadows),
          width_(width), vectors_((width + kLanes - 1) / kLanes), count_(count) {
        if (!grid_) return;
        place_ = of_row(room_->place, 0);
        inverse_z_ = of_row(room_->inverse_z, 0);
    }

    // The points of the vector that begins at pixel x; `along` is the column of each.
    HWY_INLINE void put(int x, Float u_or_v, Float inverse_z, Mask somewhere, Float along) {
        const FloatTag d;
        const Float at = hn::MulAdd(u_or_v, hn::Set(d, grid_->per_pixel), hn::Set(d, grid_->shift));
        const Float held = hn::Min(hn::Max(at, set(-kFarthestPlace)), set(kFarthestPlace));
        hn::Store(hn::IfThenElse(somewhere, held, hn::Add(along, set(kNoPlace))), d, place_ + x);
        hn::Store(inverse_z, d, inverse_z_ + x);
    }
    HWY_INLINE void put(int x, const Points& p, Mask somewhere, Float along) {
        put(x, grid_->along_u ? p.u : p.v, p.inverse_z, somewhere, along);
    }

    // When all of the row have been put. Is there any that may be hidden?
    HWY_INLINE bool find() {
        const int end = vectors_ * kLanes;
        hn::Store(hn::Add(hn::Iota(FloatTag(), static_cast<float>(end)), set(kNoPlace)), FloatTag(),
                  place_ + end);
        find_bounds();
        std::memset(cells_of_row(0), 0, grid_->room() * sizeof(Nearness));
        any_ = false;
        const int rows = std::min(count_, shadows_->reach);
        for (int back = 0; back <= rows; ++back)
            if (reaches(back, shadows_->longest_of_all)) compare_with(back);
        return any_;
    }

    HWY_INLINE bool may_be_hidden(int x) const {
        return any_ && (room_->passed.data()[counted(x / kLanes) / kLanes] >>
                        counted(x / kLanes) % kLanes) &
                           1;
    }

    // Of those that may be: the pixels of the vector that begins at x that something hides.
    HWY_INLINE Mask hidden(int x) const {
        const FloatTag d;
        const Float place = hn::Load(d, place_ + x);
        const Float inverse_z = hn::Load(d, inverse_z_ + x);
        const Float bound = hn::MulAdd(inverse_z, set(1.0 + tolerance_->relative_tolerance),
                                       hn::Set(d, tolerance_->absolute_tolerance));
        // A silhouette lies anywhere between the last pixel on it and the first beside it: half a
        // cell to both sides is searched.
        const Int cell = to_cell(hn::Sub(place, set(0.5)));
        Mask behind = hn::MaskFromVec(hn::Zero(d));
        const int rows = std::min(count_, shadows_->reach);
        const int band = x * Shadows::kBands / width_;
        const Float shortest = hn::Set(d, shadows_->shortest[band]);
        const Float longest = hn::Set(d, shadows_->longest[band]);
        for (int back = 0; back <= rows; ++back) {
            if (!reaches(back, shadows_->longest[band])) continue;
            const Float nearest = hn::BitCast(d, nearest_at(cells_of_row(back), cell));
            const Float nearer = hn::Sub(nearest, inverse_z);
            // A line that something hides at comes from that row.
            const Mask from_there =
                hn::And(hn::Ge(hn::Mul(nearer, longest), set(back - kRowSlack)),
                        hn::Le(hn::Mul(nearer, shortest), set(back + kRowSlack)));
            behind = hn::Or(behind, hn::And(hn::Gt(nearest, bound), from_there));
        }
        return hn::And(behind, is_place(place));
    }

   private:
    static HWY_INLINE Mask is_place(Float place) {  // false for NaN
        return hn::Lt(place, hn::Set(FloatTag(), kFirstNoPlace));
    }

    HWY_INLINE Int to_cell(Float place) const {
        const Float first = set(double{RowGrid::kBefore}), last = set(grid_->count - 1.0);
        // Not negative, so that what is cut off is the fraction.
        return hn::ConvertTo(IntTag(), hn::Min(hn::Max(place, first), last));
    }

    // Vectors are counted as places are; by blocks of as many as a vector of numbers of theirs.
    HWY_INLINE int counted(int vector) const {
        return grid_->near_lies_back ? vector : vectors_ - 1 - vector;
    }
    HWY_INLINE int blocks() const { return (vectors_ + kLanes - 1) / kLanes; }

    // What is kept of the rows that came last, each in its turn.
    HWY_INLINE int slot(int back) const { return (count_ - back) % (shadows_->reach + 1); }
    template <class T>
    HWY_INLINE T* of_row(AlignedRow<T>& rows, int back) const {
        return rows.data() + static_cast<std::size_t>(slot(back)) * room_->stride;
    }
    HWY_INLINE Nearness* cells_of_row(int back) const {
        return room_->cells.data() + static_cast<std::size_t>(slot(back)) * grid_->room();
    }
    // Does anything in that row hide something in this one?
    HWY_INLINE bool reaches(int back, float longest) const {
        return room_->nearest[slot(back)] * longest + kRowSlack >= back;
    }

    // Of each vector: its lowest and highest place; those of all before and behind it; and whether
    // in it, or next behind it, a place does not lie ahead of the one before. Where the nearer of
    // two surfaces lies ahead, places and vectors are counted from the end, so that it lies back.
    HWY_INLINE void find_bounds() {
        const FloatTag d;
        float *low = of_row(room_->low, 0), *high = room_->high.data();
        Vectors* breaks = of_row(room_->breaks, 0);
        std::fill_n(breaks, blocks(), 0);
        std::fill_n(of_row(room_->written, 0), blocks(), 0);
        const bool back = grid_->near_lies_back;
        Float nearest = hn::Zero(d);
        for (int i = 0; i < vectors_; ++i) {
            const float* at = place_ + i * kLanes;
            const Float here = hn::Load(d, at);
            const Float inverse_z = hn::Load(d, inverse_z_ + i * kLanes);
            const Mask is = is_place(here);
            nearest = hn::Max(nearest, hn::IfThenElseZero(is, inverse_z));
            const bool whole =
                hn::AllTrue(d, hn::Ge(hn::Sub(load(at + 1), here), set(double{kMinStep})));
            float first = at[0], last = at[kLanes - 1];
            if (HWY_UNLIKELY(!whole || last >= kFirstNoPlace)) {
                const Float none = set(2 * kNoPlace);
                first = hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(is, here, none)));
                last = hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElse(is, here, hn::Neg(none))));
            }
            const int to = counted(i);
            breaks[to / kLanes] |= Vectors{!whole && first <= last} << to % kLanes;
            low[to] = back ? first : -last;
            high[to] = back ? last : -first;
        }
        room_->nearest[slot(0)] = hn::GetLane(hn::MaxOfLanes(d, nearest));
        // Those that round the number up to whole vectors neither come back nor are passed.
        const auto none = static_cast<float>(2 * kNoPlace);
        for (int i = vectors_; i % kLanes != 0; ++i) {
            low[i] = none;
            high[i] = -none;
        }
        float *before = room_->before.data(), *behind = of_row(room_->behind, 0);
        float highest = -none, lowest = none;
        for (int i = 0, k = vectors_ - 1; i < vectors_; ++i, --k) {
            before[i] = highest;
            highest = std::max(highest, high[i]);
            behind[k] = lowest;
            lowest = std::min(lowest, low[k]);
        }
    }

    // What of the row so far back comes back over what of this one is passed.
    HWY_INLINE void compare_with(int back) {
        const FloatTag d;
        const float *low = of_row(room_->low, back), *high = room_->high.data();
        const float *behind = of_row(room_->behind, back), *before = room_->before.data();
        const Vectors* breaks = of_row(room_->breaks, back);
        Vectors *written = of_row(room_->written, back), *passed = room_->passed.data();
        const Float apart = set(back == 0 ? double{kMinStep} : -double{kMinOverlap});
        const auto bits_of = [&](const float* upper, const float* lower) HWY_ATTR {
            return bits(hn::Lt(hn::Sub(hn::Load(d, upper), hn::Load(d, lower)), apart));
        };
        for (int i = 0; i < blocks(); ++i) {
            const int first = i * kLanes;
            const Vectors here = back == 0 ? breaks[i] : passed[i];
            passed[i] = here | bits_of(behind + first, high + first);
            any_ |= passed[i] != 0;
            Vectors come = bits_of(low + first, before + first) | (back == 0 ? breaks[i] : 0);
            come &= ~written[i];
            written[i] |= come;
            for (; come; come &= come - 1) {
                const int k = first_of(come);
                write(counted(first + k), back, (breaks[i] >> k) & 1);
            }
        }
    }

    // Raises cells of that row to how near the vector's pixels are.
    HWY_INLINE void write(int vector, int back, bool breaks) const {
        const FloatTag d;
        const IntTag di;
        Nearness* cells = cells_of_row(back);
        const Float place = hn::Load(d, of_row(room_->place, back) + vector * kLanes);
        const Mask is = is_place(place);
        const Float inverse_z =
            hn::IfThenElseZero(is, hn::Load(d, of_row(room_->inverse_z, back) + vector * kLanes));
        const Int cell = to_cell(place);
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

    // What is nearest in these cells and the ones behind them, as the upper half of a float.
    HWY_INLINE Int nearest_at(const Nearness* cells, Int cell) const {
        const IntTag di;
        HWY_ALIGN std::int32_t at[kLanes];
        hn::Store(cell, di, at);
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
    float *place_ = nullptr, *inverse_z_ = nullptr;  // of this row
    bool any_ = false;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif
