! Answers questions in files: breathing half disks (table cap) with constant and Fourier laws.
!
!     mushrooms check --questions asked --seed 1
!     gfortran -O2 -o caps caps.f90 && (cd asked && ../caps > ../answers.csv)
!     mushrooms check --questions asked --answers answers.csv
!
! What it cannot do (stems, mushrooms, bang-bang laws, flows) it leaves out: that is told in the scope. Scenes and
! states are judged first, by the rules of the protocol: what breaks one is rejected, or has no next collision.
! The arc is the root of f(s) = r(t+s)^2 - |p + v s|^2. As |f''| <= bend, f stays positive up to the root h of
! f + f' h - bend h^2 / 2, whatever the law does: going on by h never misses a root.
program caps
  use iso_fortran_env, only: real64
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_positive_inf, ieee_value
  implicit none
  integer, parameter :: dp = real64, most = 16
  real(dp), parameter :: rounding = 2.0_dp**(-48)  ! f and f' are sums of a few terms, each rounded
  real(dp), parameter :: large = 1e100_dp  ! squares and cubes of larger numbers overflow
  real(dp) :: mean, omega, a(most), b(most), highest, speed, pull, t, x, y, vx, vy, t_end
  integer :: n_waves, n_sizes, n_rates, list, file, status, collisions, i
  character(len=400) :: name, line, cells(10)
  character(len=80) :: fault, trouble  ! outcome and reason of a bad scene, of a bad state; empty for a good one
  character(len=16) :: cmd, seq, wall
  logical :: is_known, is_judged

  print '(a)', 'seq,outcome,wall,dt,t,x,y,vx,vy,reason'
  open (newunit=list, file='scenes.txt', status='old', action='read')
  do
    read (list, '(a)', iostat=status) name
    if (status /= 0) exit
    open (newunit=file, file=trim(name), status='old', action='read')
    mean = 0; omega = 0; a = 0; b = 0; n_waves = 0; n_sizes = 0; n_rates = 0
    fault = ''; is_known = .true.; is_judged = .false.
    do
      read (file, '(a)', iostat=status) line
      if (status /= 0) exit
      if (line(1:1) == '#') then
        call read_scene(line(2:))
      else if (is_known .and. line(1:3) /= 'seq') then
        if (.not. is_judged) call judge_scene
        is_judged = .true.
        call split(line)
        seq = cells(1)(1:16); cmd = cells(2)(1:16); wall = cells(9)(1:16)
        if (cmd == 'flow') cycle
        trouble = fault
        if (trouble == '') call read_state
        if (trouble == '') call judge_state
        if (trouble /= '') then
          call decline(trouble)
          cycle
        end if
        do i = 1, collisions
          if (.not. moved_on()) exit
        end do
      end if
    end do
    close (file)
  end do

contains

  ! "r fourier cos 2 0.125": law, kind, field, place, number.
  subroutine read_scene(text)
    character(len=*), intent(in) :: text
    character(len=16) :: law, kind, field
    integer :: place
    real(dp) :: number
    read (text, *) law, kind
    if (law == 'table') then
      is_known = kind == 'cap'
      return
    end if
    if (kind == 'bang-bang') is_known = .false.
    if (.not. is_known) return
    read (text, *, iostat=status) law, kind, field, place, number
    if (status /= 0) then
      fault = 'rejected,a law has a line without law; kind; field; place; number'
    else if (law /= 'r' .or. (kind /= 'constant' .and. kind /= 'fourier')) then
      fault = 'rejected,a cap has one law: r; constant or fourier'
    else if (place > most) then
      fault = 'rejected,a law has more than 16 harmonics'
    else if (.not. ieee_is_finite(number)) then
      fault = 'rejected,a number of a law is not finite'
    end if
    if (fault /= '') return
    select case (field)
    case ('mean', 'value'); mean = number; n_sizes = n_sizes + 1
    case ('omega'); omega = number; n_rates = n_rates + 1
    case ('period'); omega = 8 * atan(1.0_dp) / number; n_rates = n_rates + 1
    case ('cos'); a(place) = number; n_waves = max(n_waves, place)
    case ('sin'); b(place) = number; n_waves = max(n_waves, place)
    case default; fault = 'rejected,a law has an unknown field'
    end select
    if (kind == 'constant' .and. field /= 'value') fault = 'rejected,a constant has a value alone'
    if ((field == 'omega' .or. field == 'period') .and. number <= 0) fault = 'rejected,omega or period <= 0'
  end subroutine

  ! Bounds of r, |r'| and |r''|, and whether r > 0 at all times: r stays positive for the time r / max |r'|.
  subroutine judge_scene
    real(dp) :: s, r, grown, rate, amplitude
    integer :: k
    highest = abs(mean); speed = 0; pull = 0
    do k = 1, n_waves
      amplitude = abs(a(k)) + abs(b(k))
      highest = highest + amplitude
      speed = speed + k * omega * amplitude
      pull = pull + (k * omega)**2 * amplitude
    end do
    if (fault /= '') return
    if (n_sizes /= 1) fault = 'rejected,r must be given once'
    if (n_waves > 0 .and. n_rates /= 1) fault = 'rejected,exactly one of omega and period must be given'
    if (n_rates > 1) fault = 'rejected,exactly one of omega and period must be given'
    if (fault /= '') return
    if (mean <= 0) fault = 'rejected,r must be > 0 at all times'
    if (highest < 2 * mean .or. fault /= '') return
    s = 0; t = 0
    do k = 1, 100000
      call radius(s, r, grown, rate)
      r = r + grown
      if (r < -rounding * highest) fault = 'rejected,r must be > 0 at all times'
      if (r <= rounding * highest .or. s > 8 * atan(1.0_dp) / omega) exit
      s = s + r / speed
    end do
    if (fault == '' .and. (r <= rounding * highest .or. k > 100000)) then
      fault = 'undecided,whether r > 0 at all times'
    end if
  end subroutine

  subroutine read_state
    real(dp) :: numbers(6)
    integer, parameter :: columns(6) = [4, 5, 6, 7, 8, 10]
    integer :: k
    do k = 1, 6
      read (cells(columns(k)), *, iostat=status) numbers(k)
      if (status /= 0) trouble = 'rejected,a cell of the state is no number'
    end do
    read (cells(3), *, iostat=status) collisions
    if (status /= 0) trouble = 'rejected,collisions is no whole number'
    if (trouble /= '') return
    t = numbers(1); x = numbers(2); y = numbers(3); vx = numbers(4); vy = numbers(5); t_end = numbers(6)
    if (.not. all(ieee_is_finite(numbers))) then
      trouble = 'rejected,a number is not finite'
    else if (collisions < 0) then
      trouble = 'rejected,collisions must be >= 0'
    else if (t_end < t) then
      trouble = 'rejected,t_end must be >= t'
    else if (maxval(abs(numbers(1:5))) >= large) then
      trouble = 'rejected,numbers from 1e100 on are refused: squares overflow'
    else if (wall /= '' .and. wall /= 'arc' .and. wall /= 'base') then
      trouble = 'rejected,a cap has the walls arc and base'
    end if
  end subroutine

  ! Is it in the table; is it on the wall that it names; does it leave that wall? A wall that is near within rounding
  ! is left undecided: in a corner it does not matter how the particle moves.
  subroutine judge_state
    real(dp) :: r, grown, rate, slope, off, allowed, late
    if (y == 0 .and. wall == '') wall = 'base'
    call radius(0.0_dp, r, grown, rate)
    off = (r - hypot(x, y)) * (r + hypot(x, y))
    late = abs(2 * r * rate * t)  ! the rounding of w t moves f by a small part of this
    allowed = rounding * (highest**2 + x * x + y * y + late)
    if (wall /= 'base' .and. y < 0) then
      trouble = 'rejected,it is beyond the base'
    else if (wall /= 'arc' .and. off < -allowed) then
      trouble = 'rejected,it is beyond the arc'
    else if (wall == 'arc' .and. y == 0) then
      trouble = 'undecided,it is in a corner within rounding'
    else if (wall /= 'arc' .and. off <= allowed) then
      trouble = 'undecided,it is on the arc within rounding'
    else if (wall == 'base' .and. abs(y) > 2.0_dp**(-20) * r + rounding * abs(rate * t)) then
      trouble = 'rejected,it is not on the base'
    else if (wall == 'base' .and. abs(y) > 2.0_dp**(-20) * r) then
      trouble = 'undecided,whether it is on the base'
    else if (wall == 'arc' .and. abs(off) > 2.0_dp**(-19) * r * r + rounding * late) then
      trouble = 'rejected,it is not on the arc'
    else if (wall == 'arc' .and. abs(off) > 2.0_dp**(-19) * r * r) then
      trouble = 'undecided,whether it is on the arc'
    end if
    if (trouble /= '' .or. wall == '') return
    slope = vy; allowed = 0
    if (wall == 'arc') then
      slope = 2 * (r * rate - x * vx - y * vy)
      allowed = 2 * rounding * (abs(r * rate) + abs(x * vx) + abs(y * vy) + abs(t) * (speed**2 + highest * pull))
    end if
    if (slope < -allowed) then
      trouble = 'rejected,it moves into the wall that it leaves'
    else if (wall == 'base' .and. slope == 0 .and. t_end > t) then
      trouble = 'undefined,sliding'
    else if (wall == 'arc' .and. slope <= allowed .and. (t_end > t .or. allowed > 0)) then
      trouble = 'undecided,whether it leaves the arc'
    end if
  end subroutine

  subroutine split(text)
    character(len=*), intent(in) :: text
    integer :: k, from, comma
    from = 1
    do k = 1, 10
      comma = index(text(from:)//',', ',')
      cells(k) = text(from:min(from + comma - 2, len(text)))
      from = min(from + comma, len(text))
    end do
  end subroutine

  ! r at t, how much it has grown after s (without cancellation), and its rate then.
  subroutine radius(s, r, grown, rate)
    real(dp), intent(in) :: s
    real(dp), intent(out) :: r, grown, rate
    real(dp) :: w, middle, half
    integer :: k
    r = mean; grown = 0; rate = 0
    do k = 1, n_waves
      w = k * omega; middle = w * (t + s / 2); half = sin(w * s / 2)
      r = r + a(k) * cos(w * t) + b(k) * sin(w * t)
      grown = grown + 2 * half * (b(k) * cos(middle) - a(k) * sin(middle))
      rate = rate + w * (b(k) * cos(w * (t + s)) - a(k) * sin(w * (t + s)))
    end do
  end subroutine

  subroutine gap(s, f, slope)
    real(dp), intent(in) :: s
    real(dp), intent(out) :: f, slope
    real(dp) :: r, grown, rate
    call radius(s, r, grown, rate)
    f = grown * (2 * r + grown) - s * (2 * (x * vx + y * vy) + s * (vx * vx + vy * vy))
    if (wall /= 'arc') f = f + (r - hypot(x, y)) * (r + hypot(x, y))
    slope = 2 * ((r + grown) * rate - (x * vx + y * vy) - s * (vx * vx + vy * vy))
  end subroutine

  ! Take one step and print it; false when the path ends with it.
  logical function moved_on()
    real(dp) :: s, h, f, slope, bend, r, grown, rate, base, end, nx, ny, push
    integer :: k
    moved_on = .false.
    if (t_end == t) then
      call tell('horizon,', 0.0_dp)
      return
    end if
    bend = 2 * (speed**2 + highest * pull + vx * vx + vy * vy)
    base = ieee_value(base, ieee_positive_inf)
    if (y > 0 .and. vy < 0 .and. wall /= 'base') base = -y / vy
    end = min(base, t_end - t)
    s = 0
    do k = 1, 100000
      if (s > end) exit
      call gap(s, f, slope)
      h = 2 * max(f, 0.0_dp) / (sqrt(slope**2 + 2 * bend * max(f, 0.0_dp)) - slope)
      if (slope > 0) h = (slope + sqrt(slope**2 + 2 * bend * max(f, 0.0_dp))) / bend
      if (h <= 2.0_dp**(-53) * s) exit
      s = s + h
    end do
    if (k > 100000 .or. s == 0 .or. abs(s / base - 1) <= 1e-12_dp) then
      call decline('undecided,two walls at once or the arc is grazed; within rounding')
      return
    end if
    if (s < end) then
      do k = 1, 3
        call gap(s, f, slope)
        if (slope < 0) s = s - f / slope
      end do
      call radius(s, r, grown, rate)
      x = x + vx * s; y = y + vy * s; wall = 'arc'
      nx = x / hypot(x, y); ny = y / hypot(x, y)
      ! The wall's speed -f_t / |grad f|: r may be off |p| by what the start was off its wall.
      push = 2 * (vx * nx + vy * ny - rate * (r + grown) / hypot(x, y))
      vx = vx - push * nx; vy = vy - push * ny
    else
      s = end
      x = x + vx * s; y = y + vy * s
      if (base <= t_end - t) then
        y = 0; vy = -vy; wall = 'base'
      else
        t = t_end
        call tell('horizon,', s)
        return
      end if
    end if
    t = t + s
    moved_on = .true.
    call tell('collision,'//trim(wall), s)
  end function

  ! Print an outcome without numbers: "outcome,reason".
  subroutine decline(why)
    character(len=*), intent(in) :: why
    integer :: comma
    comma = index(why, ',')
    print '(a)', trim(seq)//','//why(:comma - 1)//',,,,,,,,'//trim(why(comma + 1:))
  end subroutine

  subroutine tell(what, s)
    character(len=*), intent(in) :: what
    real(dp), intent(in) :: s
    character(len=26) :: numbers(6)
    real(dp) :: all(6)
    integer :: k
    all = [s, t, x, y, vx, vy]
    do k = 1, 6
      write (numbers(k), '(es25.17e3)') all(k)
    end do
    print '(a,6(",",a),",")', trim(seq)//','//what, (trim(adjustl(numbers(k))), k=1, 6)
  end subroutine
end program
