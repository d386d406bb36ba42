use proprio::device::*;
use proprio::device::replay::*;
use proprio_core::go2::Leg;
use proprio_core::wire::*;
use proprio_tests::motion;
fn main(){
  for scalar in [image::Scalar::F64] {
    let img = image::build(scalar).unwrap();
    let mut q = Qemu::boot(&img).unwrap();
    let t=std::time::Instant::now();
    let mut last=None; let mut n=0;
    let steps=(1..=3000u64).map(|n| bus_step(n*2000,&Leg::ALL.map(|l|Some(motion::sample(l,n)))));
    replay(steps,&mut q,&mut |m| match m {DeviceMessage::Counters(c)=>last=Some(c), DeviceMessage::Estimate(_)=>n+=1, _=>{}}).unwrap();
    let l=last.unwrap().load;
    println!("{:?} {:?} {n} est {:?} mean {}", scalar, t.elapsed(), l, l.total/l.ticks as u64);
  }
}
