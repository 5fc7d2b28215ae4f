% One cycle of the moving cap (sec. 4.2) for N particles of energy E0, written as CSV for the audit.
% GNU Octave or MATLAB:
%     octave cycle.m
%     mushrooms audit --ensemble ensemble.csv --scene moving-cap
1;

function [r, w, h, r1, w1, h1] = laws(t)
  r = 1 + 0.5 * sin(t); r1 = 0.5 * cos(t);
  nu = 0.6 + 0.4 * cos(t); nu1 = -0.4 * sin(t);
  w = nu * r; w1 = nu1 * r + nu * r1;
  h = 1 - 0.5 * sin(t); h1 = -r1;
end

% Time and wall met next: 0 arc, 1 mouth or base, 2 right, 3 left, 4 floor.
function [best, which] = next_hit(p, t, wall, slope)
  x = p(1); y = p(2); vx = p(3); vy = p(4);
  best = Inf; which = -1;
  if wall ~= 1 && y * vy < 0
    best = -y / vy; which = 1;
  end
  if y > 0 || (y == 0 && vy > 0)
    r = laws(t);
    b = x * vx + y * vy; c = min(x * x + y * y - r * r, 0); v2 = vx * vx + vy * vy;
    s = (-b + sqrt(max(b * b - v2 * c, 0))) / v2;
    for k = 1:8
      [r, ~, ~, r1] = laws(t + s);
      f = (x + vx * s)^2 + (y + vy * s)^2 - r * r;
      s = s - f / (2 * ((x + vx * s) * vx + (y + vy * s) * vy - r * r1));
    end
    if s > 0 && s < best
      best = s; which = 0;
    end
    return
  end
  for k = [2 3 4]
    if k == wall
      continue
    end
    sign = 1 - 2 * (k == 3); s = 0;
    for i = 1:8
      [~, w, h, ~, w1, h1] = laws(t + s);
      if k == 4
        f = y + vy * s + h; f1 = vy + h1;
      else
        f = w + slope * (y + vy * s) - sign * (x + vx * s);
        f1 = w1 + slope * vy - sign * vx;
      end
      if f1 < 0
        s = s - f / f1;
      else
        s = Inf;
      end
      if ~(s < best)
        break
      end
    end
    if s > 0 && s < best
      best = s; which = k;
    end
  end
end

% Energy after the cycle, and begin and end of the captured stay at the time of least nu.
function [e, t_in, t_out] = cycle(p, slope)
  t = 0; wall = -1; first = Inf; last = Inf; t_in = NaN; t_out = NaN; t_end = 2 * pi;
  while true
    [s, wall] = next_hit(p, t, wall, slope);
    if ~(t + s < t_end)
      break
    end
    t = t + s; x = p(1) + p(3) * s; y = p(2) + p(4) * s; vx = p(3); vy = p(4);
    [r, w, ~, r1, w1, h1] = laws(t);
    n = [x, y] / r; u = r1;
    if wall == 4
      n = [0, -1]; u = h1;
    elseif wall >= 2
      n = [1 - 2 * (wall == 3), -slope] / sqrt(1 + slope^2); u = w1 / sqrt(1 + slope^2);
    end
    if wall == 0 && abs(x * vy - y * vx) > w * hypot(vx, vy)
      first = min(first, t); last = Inf;
    elseif wall == 0 && first < Inf
      last = min(last, t);
    elseif wall >= 2
      if first <= pi && pi <= min(last, t)
        t_in = first; t_out = min(last, t);
      end
      first = Inf; last = Inf;
    end
    if wall == 1
      y = 0;
      if ~(abs(x) < w || vy > 0)
        vy = -vy;
      end
    else
      push = 2 * (vx * n(1) + vy * n(2) - u);
      vx = vx - push * n(1); vy = vy - push * n(2);
    end
    p = [x, y, vx, vy];
  end
  if first <= pi && pi <= min(last, t_end)
    t_in = first; t_out = min(last, t_end);
  end
  e = (p(3)^2 + p(4)^2) / 2;
end

n_particles = 1000; E0 = 1e4; slope = 0.1111;
file = fopen('ensemble.csv', 'w');
fprintf(file, 'E0,E1,t_in,t_out\n');
for i = 1:n_particles
  while true  % uniform in area
    x = 2 * rand - 1; y = 2 * rand - 1;
    if (y > 0 && hypot(x, y) < 1) || (y <= 0 && abs(x) < 1 + slope * y)
      break
    end
  end
  angle = 2 * pi * rand; v = sqrt(2 * E0);
  [e, t_in, t_out] = cycle([x, y, v * cos(angle), v * sin(angle)], slope);
  fprintf(file, '%.17g,%.17g,%.17g,%.17g\n', E0, e, t_in, t_out);
end
fclose(file);
