! Answers questions in files: breathing half disks (table cap) with constant and Fourier laws.
!
!     mushrooms check --questions asked --seed 1
!     gfortran -O2 -o caps caps.f90 && (cd asked && ../caps > ../answers.csv)
!     mushrooms check --questions asked --answers answers.csv
!
! What it cannot do (stems, mushrooms, bang-bang laws, flows) it leaves out: that is told in the scope.
! The arc is the root of f(s) = r(t+s)^2 - |p + v s|^2. As |f''| <= bend, f stays positive up to the root h of
! f + f' h - bend h^2 / 2, whatever the law does: going on by h never misses a root.
program caps
  use iso_fortran_env, only: real64
  implicit none
  integer, parameter :: dp = real64, most = 64
  real(dp) :: mean, omega, a(most), b(most), t, x, y, vx, vy, t_end
  integer :: n_waves, list, file, status, collisions, i
  character(len=400) :: name, line, cells(10)
  character(len=16) :: cmd, seq, wall
  logical :: is_known

  print '(a)', 'seq,outcome,wall,dt,t,x,y,vx,vy'
  open (newunit=list, file='scenes.txt', status='old', action='read')
  do
    read (list, '(a)', iostat=status) name
    if (status /= 0) exit
    open (newunit=file, file=trim(name), status='old', action='read')
    mean = 0; omega = 0; a = 0; b = 0; n_waves = 0; is_known = .true.
    do
      read (file, '(a)', iostat=status) line
      if (status /= 0) exit
      if (line(1:1) == '#') then
        call read_scene(line(2:))
      else if (is_known .and. line(1:3) /= 'seq') then
        call split(line)
        seq = cells(1)(1:16); cmd = cells(2)(1:16); wall = cells(9)(1:16)
        if (cmd == 'flow') cycle
        read (cells(3), *) collisions
        read (cells(4), *) t; read (cells(5), *) x; read (cells(6), *) y
        read (cells(7), *) vx; read (cells(8), *) vy; read (cells(10), *) t_end
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
    if (kind == 'bang-bang' .or. .not. is_known) then
      is_known = .false.
      return
    end if
    read (text, *) law, kind, field, place, number
    if (place > most) is_known = .false.
    if (.not. is_known) return
    select case (field)
    case ('mean', 'value'); mean = number
    case ('omega'); omega = number
    case ('period'); omega = 8 * atan(1.0_dp) / number
    case ('cos'); a(place) = number; n_waves = max(n_waves, place)
    case ('sin'); b(place) = number; n_waves = max(n_waves, place)
    end select
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
    real(dp) :: s, h, f, slope, bend, r, grown, rate, base, end, speed, pull, nx, ny, push
    integer :: k
    speed = 0; pull = 0; r = abs(mean)
    do k = 1, n_waves
      r = r + abs(a(k)) + abs(b(k))
      speed = speed + k * omega * (abs(a(k)) + abs(b(k)))
      pull = pull + (k * omega)**2 * (abs(a(k)) + abs(b(k)))
    end do
    bend = 2 * (speed**2 + r * pull + vx * vx + vy * vy)
    base = huge(base)
    if (y > 0 .and. vy < 0 .and. wall /= 'base') base = -y / vy
    end = min(base, t_end - t)
    s = 0
    do k = 1, 100000
      call gap(s, f, slope)
      h = 2 * max(f, 0.0_dp) / (sqrt(slope**2 + 2 * bend * max(f, 0.0_dp)) - slope)
      if (slope > 0) h = (slope + sqrt(slope**2 + 2 * bend * max(f, 0.0_dp))) / bend
      if (h <= 2.0_dp**(-53) * s .or. s > end) exit
      s = s + h
    end do
    moved_on = .false.
    if (t_end == t) then
      ! It has arrived, if it is inside, or on a wall that it leaves or slides along.
      call gap(0.0_dp, f, slope)
      if (wall == 'arc') f = slope
      if (f > 0 .and. (y > 0 .or. (y == 0 .and. vy >= 0))) then
        call tell('horizon,', 0.0_dp)
        return
      end if
    end if
    if (k > 100000 .or. s == 0 .or. t_end == t .or. abs(s - base) <= 1e-12_dp * s .or. (y == 0 .and. vy == 0)) then
      print '(a)', trim(seq)//',undecided,,,,,,,'
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
    print '(a,6(",",a))', trim(seq)//','//what, (trim(adjustl(numbers(k))), k=1, 6)
  end subroutine
end program
