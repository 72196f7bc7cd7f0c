//! Exploration.
use servo::*;
fn acc(x: f64) -> Acceleration { Acceleration::from_bits((x * (1u64<<48) as f64 / (std::f64::consts::TAU*64e6)) as u64) }
fn jrk(x: f64) -> Jerk { Jerk::from_bits((x * (1u64<<48) as f64 / (std::f64::consts::TAU*512e9)) as u64) }
fn vel(x: f64) -> Velocity { Velocity::saturating_from_bits((x*2f64.powi(36)/(std::f64::consts::TAU*8000.0)) as i64) }
#[test]
fn explore() {
    for (v, a, d, j) in [(100.0,1000.0,1000.0,None),(1500.0,1e6,10.0,None),(100.0,1000.,500.,Some(1e5)),(100.0,1000.,500.,Some(1e4)),(10.0,1000.,1000.,Some(1e9)),(1500.,1e6,1e6,Some(1e6)),(1500.,1e6,1e6,Some(1e9)),(1500.,10.,10.,Some(1.)),(1500.,100.,100.,Some(100.)),(1.0,1e6,1e6,Some(1e9f64))] {
        for rad in [1e-9, 1e-6,1e-4,1e-2,1.0,100.0,1e4] {
            let limits = MotionLimits::new(vel(v), acc(a), acc(d), j.map(jrk)).unwrap();
            let bits = (rad/std::f64::consts::TAU*2f64.powi(32)) as i64;
            let target = Position::from_bits(bits);
            let mut t = Trajectory::start(Setpoint::moving(Position::ZERO, Velocity::ZERO));
            let (mut n, mut over, mut last, mut amax, mut amin, mut jmax, mut vmin) = (0, 0i64, SignedAcceleration::ZERO,0i64,0i64,0i64,0i32);
            let mut tail=vec![];
            while !t.is_finished() && n < 3_000_000 {
                let s = t.tick_to(&limits, target);
                over = over.max(s.position.to_bits() - bits);
                amax = amax.max(s.acceleration.to_bits()); amin = amin.min(s.acceleration.to_bits());
                jmax = jmax.max((s.acceleration.to_bits()-last.to_bits()).abs()); vmin=vmin.min(s.velocity.to_bits());
                last = s.acceleration; n += 1;
                tail.push(s);
            }
            // closed form in ticks
            let c = match j {
                None => { let vp = (2.0*rad*a*d/(a+d)).sqrt().min(v); (vp/a+vp/d + (rad - vp*vp/2./a - vp*vp/2./d)/vp)*8000.0 }
                Some(j) => {
                    let j = j.min(a/4.0*8000.).min(d/4.*8000.);
                    let ramp = |v:f64,a:f64| if v*j<a*a {2.*(v/j).sqrt()} else {v/a+a/j};
                    let way = |vp:f64| vp*(ramp(vp,a)+ramp(vp,d))/2.0;
                    let (mut lo, mut hi)=(0.0,v); for _ in 0..100 { let m=(lo+hi)/2.; if way(m)<rad {lo=m} else {hi=m} }
                    (ramp(lo,a)+ramp(lo,d)+(rad-way(lo)).max(0.)/lo)*8000.
                }};
            let abits=acc(a).to_bits() as f64; let dbits=acc(d).to_bits() as f64; 
            println!("v{v} a{a} d{d} j{j:?} way {rad}: {n} ticks, closed {c:.1} ratio {:.4} over {over} amax {:.3} amin {:.3} j {:.3} vmin {vmin}", n as f64/c, amax as f64/abits, amin as f64/dbits, j.map_or(0.0,|j|jmax as f64/jrk(j).to_bits() as f64));
            if std::env::var("TAIL").is_ok() && n<100 { for s in &tail { println!("  {} {} {}", s.position.to_bits()-bits, s.velocity.to_bits(), s.acceleration.to_bits()); } }
        }
    }
}
#[test]
fn tail() {

    for (v,a,d,j,rad,from,st) in [(395.,213102.3,213102.3,26217.,4.842178397802329e-2,150,4),(409.868,14640.66,14640.66,3173869.0854045777,1.0187488702712166e3,20010,3),(72.833,135893.41,117912.50,180982409.28949642,1.6725390653464322e2,18365,1)] {
    let limits = MotionLimits::new(vel(v), acc(a), acc(d), Some(jrk(j))).unwrap();
    let jb = jrk(j).to_bits().min(acc(a.min(d)).to_bits()/4) as f64;
    let bits = (rad/std::f64::consts::TAU*2f64.powi(32)) as i64;
    let mut t = Trajectory::start(Setpoint::moving(Position::ZERO, Velocity::ZERO));
    let mut n = 0; let mut last=0.0;
    println!("case j {jb}");
    while !t.is_finished() && n<300000 { let s = t.tick_to(&limits, Position::from_bits(bits)); n+=1; let aa=s.acceleration.to_bits() as f64/jb; if n>from && n % st == 0 { println!("{n} e {:.2} v {:.2} a {:.3} u {:.3}", (bits-s.position.to_bits()) as f64/jb*65536., s.velocity.to_bits() as f64/jb*4096., aa, aa-last); } last=aa; }
    }
}
#[test]
fn fuzz() {
    let mut seed = 12345u64;
    let mut rnd = move || { seed ^= seed<<13; seed ^= seed>>7; seed ^= seed<<17; (seed>>11) as f64/(1u64<<53) as f64 };
    let mut worst: Vec<(f64,String)> = vec![];
    let (mut cnt, mut overs) = (0,0);
    for _ in 0..3000 {
        let v = 10f64.powf(rnd()*4.0-1.0).min(1570.0); let a = 10f64.powf(rnd()*6.0); let d = if rnd()<0.5 {a} else {10f64.powf(rnd()*6.0)};
        let j = if rnd()<0.3 {None} else {Some(10f64.powf(rnd()*9.0))};
        let rad = 10f64.powf(rnd()*12.0-8.0);
        let Ok(limits) = MotionLimits::new(vel(v), acc(a), acc(d), j.map(jrk)) else {continue};
        let jb = j.map_or(i64::MAX, |j| jrk(j).to_bits() as i64);
            let c = match j {
                None => { let vp = (2.0*rad*a*d/(a+d)).sqrt().min(v); (vp/a+vp/d + (rad - vp*vp/2./a - vp*vp/2./d)/vp)*8000.0 }
                Some(j) => {
                    let j = j.min(a/4.0*8000.).min(d/4.*8000.);
                    let ramp = |v:f64,a:f64| if v*j<a*a {2.*(v/j).sqrt()} else {v/a+a/j};
                    let way = |vp:f64| vp*(ramp(vp,a)+ramp(vp,d))/2.0;
                    let (mut lo, mut hi)=(0.0,v); for _ in 0..100 { let m=(lo+hi)/2.; if way(m)<rad {lo=m} else {hi=m} }
                    (ramp(lo,a)+ramp(lo,d)+(rad-way(lo)).max(0.)/lo)*8000.
                }};
        if c > 1e5 {continue}
        cnt+=1;
            let bits = (rad/std::f64::consts::TAU*2f64.powi(32)) as i64;
            let target = Position::from_bits(bits);
            let mut t = Trajectory::start(Setpoint::moving(Position::ZERO, Velocity::ZERO));
            let (mut n, mut over, mut last) = (0, 0i64, SignedAcceleration::ZERO);
            let mut bad=0;
            while !t.is_finished() && n < 1_000_000 {
                let s = t.tick_to(&limits, target);
                over = over.max(s.position.to_bits() - bits);
                if s.velocity>vel(v) || s.acceleration.to_bits()>acc(a).to_bits() as i64 || -s.acceleration.to_bits()>acc(d).to_bits() as i64 || (s.acceleration.to_bits()-last.to_bits()).abs()>jb {bad+=1;}
                last = s.acceleration; n += 1;
            }
        let text=format!("v{v:.3} a{a:.2} d{d:.2} j{j:?} way {rad:e}: {n} ticks, closed {c:.1} ratio {:.4} over {over} bad {bad}", n as f64/c);
        if over>0||bad>0 { overs+=1; println!("{text}"); }
        worst.push(((n as f64-c)/(c*0.02+4.0), text));
    }
    worst.sort_by(|a,b| b.0.total_cmp(&a.0));
    println!("count {cnt} overs {overs}");
    for w in worst.iter().take(25) { println!("{:.2} {}", w.0, w.1); }
}
